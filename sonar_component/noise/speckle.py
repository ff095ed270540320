"""Speckle: beams x bins times a noise that is correlated across beams, along bins and from ping to ping.

Each ping gets a field E of standard normal numbers, made by two recursive filters of first order from table look-ups of
random bits. What stays from ping to ping is a second field P of the same kind; the factor is law(sqrt(r) P +
sqrt(1 - r) E) with r the ping correlation. So two pings from one place are equally alike whether one or ten pings lie
between them, as measured (see properties.py); with one recursive filter over pings, which was the alternative, they
would be strangers after ten. P itself is stirred by E when the sonar moves: speckle belongs to the place from where it
is seen.

numpy's normal numbers alone take 1.0 ms for 256 x 500; random bits, look-up, filters, law and product together take
about 0.25 ms. The look-up has 65 536 entries, so a number beyond 4.2 standard deviations does not occur.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache
from statistics import NormalDist
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from sonar_component.noise.law import REACH, Law
from sonar_component.noise.properties import SpeckleProperties

Image = NDArray[np.float32]


@dataclass
class _State:
    """What one sonar's speckle remembers; row per beam of a fan or per place of a scanning head."""

    held: Image
    fresh: Image
    known: NDArray[np.bool_]
    stirred: NDArray[np.float64]
    last_place: int | None = None
    total: float = 0.0


@dataclass
class Speckle:
    """Multiplies images by speckle; remembers what ping-to-ping correlation needs.

    Attributes
    ----------
    properties : SpeckleProperties
    """

    properties: SpeckleProperties
    _state: _State | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        self._law = _packed(self.properties.distribution())
        self._bin = _lag_one(self.properties.bin_correlation_length)
        self._beam = _lag_one(self.properties.beam_correlation_length)

    def apply(self, bins: Image, rng: np.random.Generator, stirred: float = 0.0) -> Image:
        """Multiply a fan, in place.

        Parameters
        ----------
        bins : (beams, bins) float32
        rng : numpy Generator
            The only source of chance: same generator, same pings, same bits.
        stirred : float
            How far the sonar moved since the last ping, in decorrelation lengths [-]: see ``stirring``.

        Returns
        -------
        (beams, bins) float32
            The same array.
        """
        state = self._remember(len(bins), *bins.shape)
        state.total += stirred
        self._multiply(bins, state, slice(0, len(bins)), rng)
        return bins

    def apply_beam(self, bins: Image, place: int, places: int, rng: np.random.Generator, stirred: float = 0.0) -> Image:
        """Multiply one beam of a scanning head, (1, bins), in place; `place` of `places` is where the head looks.

        Neighbours in bearing are then pings that follow each other, and what stays is kept for each place until the
        head comes there again.
        """
        state = self._remember(places, *bins.shape)
        state.total += stirred
        self._multiply(bins, state, slice(place, place + 1), rng)
        state.last_place = place
        return bins

    def stirring(self, distance: float, angle: float) -> float:
        """Motion between two pings in decorrelation lengths [-], from metres and radians."""
        return distance / self.properties.decorrelation_length + angle / self.properties.decorrelation_angle

    def _remember(self, rows: int, beams: int, bin_count: int) -> _State:
        state = self._state
        if state is None or state.held.shape != (rows, bin_count):
            held, fresh = (np.zeros((n, bin_count), np.float32) for n in (rows, beams))
            state = self._state = _State(held, fresh, np.zeros(rows, bool), np.zeros(rows))
        return state

    def _multiply(self, bins: Image, state: _State, rows: slice, rng: np.random.Generator) -> None:
        stays = self.properties.ping_correlation
        held, place = state.held[rows], state.last_place
        if stays > 0 and not state.known[rows.start]:
            self._draw(held, None if place is None else state.held[place], rng)
            state.known[rows], state.stirred[rows] = True, state.total
        keep = math.exp(-(state.total - float(state.stirred[rows.start])))
        state.stirred[rows] = state.total
        if stays < 1 or keep < 1:
            self._draw(state.fresh, None if place is None else state.fresh[-1].copy(), rng)
        stir = math.sqrt(1 - keep * keep) if stays > 0 else 0.0
        # P is stirred by the very E that it is added to, so their sum has this deviation instead of 1.
        deviation = math.sqrt(1 + 2 * math.sqrt(stays * (1 - stays)) * stir)
        weights = [keep, stir, math.sqrt(stays) / deviation, math.sqrt(1 - stays) / deviation]
        floor = np.float32(self.properties.floor)
        _mix(bins, state.fresh, held, np.array(weights, np.float32), *self._law, floor)

    def _draw(self, out: Image, before: Image | None, rng: np.random.Generator) -> None:
        """Fill a field with new correlated normal numbers; `before` is the beam on the left of its first, (bins,)."""
        words = rng.integers(0, 0xFFFF_FFFF_FFFF_FFFF, -(-out.size // 4), dtype=np.uint64, endpoint=True)
        codes = words.view(np.uint16)[: out.size].reshape(out.shape)
        left = before if before is not None else np.empty(0, np.float32)
        _filter(codes, _normal_table(self._bin), np.float32(self._bin), np.float32(self._beam), left, out)


def _lag_one(length: float) -> float:
    """Correlation of neighbours for a correlation length [neighbours]."""
    return math.exp(-1 / length) if length > 0 else 0.0


def _packed(law: Law) -> tuple[Any, ...]:
    return law.coefficients.astype(np.float32), law.power, law.folded, np.float32(REACH)


@lru_cache(maxsize=4)
def _normal_table(correlation: float) -> Image:
    """Normal numbers for 16 random bits, scaled as the filter along the bins needs them."""
    half = [NormalDist().inv_cdf((i + 0.5) / 65536) for i in range(32768, 65536)]
    upper = np.array(half)
    table = np.concatenate([-upper[::-1], upper])
    table *= math.sqrt(1 - correlation**2) / table.std()
    return table.astype(np.float32)


@numba.njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _filter(codes: Any, table: Any, along: Any, across: Any, left: Any, out: Any) -> None:
    """Filter random bits along the bins and across the beams; four beams side by side, or each waits for itself."""
    rows, count = codes.shape
    one = np.float32(1.0)
    innovation = np.float32(np.sqrt(one - across * across))
    start = np.float32(1.0) / np.float32(np.sqrt(one - along * along))  # the first bin has no past to lean on
    row = np.empty(count, np.float32)
    first = left.shape[0] == 0
    if not first:
        row[:] = left
    done = 0
    if first and rows:
        x = np.float32(0.0)
        for k in range(count):
            new = table[codes[0, k]]
            x = new * start if k == 0 else along * x + new
            row[k] = x
            out[0, k] = x
        done = 1
    while done + 4 <= rows:
        x0 = x1 = x2 = x3 = np.float32(0.0)
        for k in range(count):
            scale = start if k == 0 else one
            x0 = along * x0 + scale * table[codes[done, k]]
            x1 = along * x1 + scale * table[codes[done + 1, k]]
            x2 = along * x2 + scale * table[codes[done + 2, k]]
            x3 = along * x3 + scale * table[codes[done + 3, k]]
            y = across * row[k] + innovation * x0
            out[done, k] = y
            y = across * y + innovation * x1
            out[done + 1, k] = y
            y = across * y + innovation * x2
            out[done + 2, k] = y
            y = across * y + innovation * x3
            out[done + 3, k] = y
            row[k] = y
        done += 4
    for r in range(done, rows):
        x = np.float32(0.0)
        for k in range(count):
            x = along * x + (start if k == 0 else one) * table[codes[r, k]]
            row[k] = across * row[k] + innovation * x
            out[r, k] = row[k]


@numba.njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract"})  # type: ignore[untyped-decorator]
def _mix(
    bins: Any, fresh: Any, held: Any, weights: Any, c: Any, power: Any, folded: Any, reach: Any, floor: Any
) -> None:
    """Stir what is held, take the law of the sum, multiply. Written for vector registers: no branch in the loop."""
    keep, stir, of_held, of_fresh = weights[0], weights[1], weights[2], weights[3]
    c0, c1, c2, c3, c4, c5, c6, c7, c8, c9 = c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8], c[9]
    zero = np.float32(0.0)
    low = np.float32(-1.0) if folded else zero
    cube = power == 3
    rows, count = bins.shape
    for r in range(rows):
        for k in range(count):
            p = keep * held[r, k] + stir * fresh[r, k]
            held[r, k] = p
            z = of_held * p + of_fresh * fresh[r, k]
            z = z if z < reach else reach
            z = z if z > -reach else -reach
            value = c0 + z * (c1 + z * (c2 + z * (c3 + z * (c4 + z * (c5 + z * (c6 + z * (c7 + z * (c8 + z * c9))))))))
            value = value if value > zero else low * value
            value = value * value * value if cube else value
            echo = bins[r, k]
            bins[r, k] = (echo if echo > floor else floor) * value
