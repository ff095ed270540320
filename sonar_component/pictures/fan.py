"""Beams x bins -> a picture of the fan seen from above: forward is up, left is left, metres are square.

Decision: the mapping is inverse, by a table that says for every output pixel which beam and which bin it shows. The
forward way (drawing each bin where it belongs) leaves holes at long range and overdraws at short range, and drawing
each bin as a quadrilateral costs 128 000 polygons a frame. The table depends only on geometry, so it is made once per
setting and kept. The nearest bin is shown as it was measured; linear interpolation is offered, but it is not the
default, because it invents values between beams that a cursor would then read.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from threading import Lock
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sonar_component.samples import Sonar

Interpolation = Literal["nearest", "linear"]

_TURN = 2 * np.pi  # [rad]
_LONE_BEAM = np.radians(1.0)  # [rad], drawn width of a single beam that does not state its width
_KEPT_MAPS = 8  # [-], a viewer shows a few sonars in a few sizes; a map of 800 x 800 pixels is 5 MB


@dataclass(frozen=True)
class FanMap:
    """Which beam and which bin each pixel of a fan picture shows.

    Attributes
    ----------
    beam, bin : (rows, columns) float32
        Fractional indices into ``Sonar.bins``: beam 2.0 is the centre of beam 2, bin 7.0 the middle of bin 7. Row 0 is
        the farthest ahead, column 0 the farthest to the left.
    index : (rows, columns) int32
        ``beam * bin_count + bin`` of the cell that holds the pixel's centre; -1 outside the fan.
    extent : tuple of float
        Left, right, bottom and top edge of the picture [m], in the sonar's axes: left is y (positive), top is x.
    """

    beam: NDArray[np.float32]
    bin: NDArray[np.float32]
    index: NDArray[np.int32]
    extent: tuple[float, float, float, float]

    @property
    def inside(self) -> NDArray[np.bool_]:
        """Pixels that belong to the fan, (rows, columns) bool."""
        return self.index >= 0

    def apply(self, bins: NDArray[np.float32], interpolation: Interpolation = "nearest") -> NDArray[np.float32]:
        """Draw beams x bins into the picture.

        Parameters
        ----------
        bins : (beams, bins) float32
        interpolation : "nearest" or "linear"

        Returns
        -------
        (rows, columns) float32
            NaN outside the fan, and where the measurement is NaN.
        """
        if interpolation == "nearest":
            picture = bins.ravel()[np.maximum(self.index, 0)].astype(np.float32, copy=False)
        else:
            picture = self._linear(bins)
        picture[~self.inside] = np.nan
        return picture

    def _linear(self, bins: NDArray[np.float32]) -> NDArray[np.float32]:
        """Bilinear in bearing and range; a pixel that touches a NaN cell keeps its own cell's value."""
        last_beam, last_bin = bins.shape[0] - 1, bins.shape[1] - 1
        beam, bin_ = np.clip(self.beam, 0, last_beam), np.clip(self.bin, 0, last_bin)
        b0, k0 = beam.astype(np.intp), bin_.astype(np.intp)
        b1, k1 = np.minimum(b0 + 1, last_beam), np.minimum(k0 + 1, last_bin)
        v, u = beam - b0, bin_ - k0
        near, far = bins[b0, k0] * (1 - v) + bins[b1, k0] * v, bins[b0, k1] * (1 - v) + bins[b1, k1] * v
        smooth = (near * (1 - u) + far * u).astype(np.float32)
        own = bins.ravel()[np.maximum(self.index, 0)]
        return np.where(np.isnan(smooth), own, smooth)


def beam_edges(bearings: NDArray[np.float64], beam_width: float = float("nan")) -> NDArray[np.float64]:
    """Where beams meet: midway between neighbouring centres, and as far beyond the outer centres.

    Parameters
    ----------
    bearings : (beams,) float64
        Beam centres [rad], rising.
    beam_width : float
        Opening of the whole fan [rad]; used only for a single beam. NaN: 1 degree.

    Returns
    -------
    (beams + 1,) float64 [rad]
        Never more than a full turn from first to last: a 360 degree fan closes midway between its last and first beam.
    """
    if bearings.size == 1:
        half = (beam_width if beam_width > 0 else _LONE_BEAM) / 2
        return np.array([bearings[0] - half, bearings[0] + half])
    between = (bearings[:-1] + bearings[1:]) / 2
    first = bearings[0] - (between[0] - bearings[0])
    last = bearings[-1] + (bearings[-1] - between[-1])
    if last - first > _TURN:
        last = (bearings[-1] + bearings[0] + _TURN) / 2
        first = last - _TURN
    return np.concatenate([[first], between, [last]])


def fan_map(sonar: Sonar, size: int = 800) -> FanMap:
    """The pixel table of a sonar's fan, taken from a small store if its geometry was drawn before.

    Parameters
    ----------
    sonar : Sonar
        Only its geometry is used: bearings, beam_width, bin_count and the length of a bin.
    size : int
        Pixels of the picture's longer side.

    Raises
    ------
    ValueError
        If the sonar's fields do not fit together, or there is nothing to draw.
    """
    sonar.validate()
    if sonar.beam_count == 0 or sonar.bin_count == 0:
        raise ValueError(f"bins must hold at least one beam and one bin, got {sonar.beam_count} x {sonar.bin_count}")
    if not np.isfinite(sonar.bearings).all():
        raise ValueError("bearings must be finite numbers [rad]")
    # As bytes, because an unset beam_width is NaN, which equals nothing.
    key = (sonar.bearings.tobytes(), np.array([sonar.beam_width, sonar.bin_length]).tobytes(), sonar.bin_count, size)
    with _lock:
        if key in _store:
            _store.move_to_end(key)
            return _store[key]
    made = _make(sonar, size)
    with _lock:
        _store[key] = made
        if len(_store) > _KEPT_MAPS:
            _store.popitem(last=False)
    return made


_store: OrderedDict[tuple[object, ...], FanMap] = OrderedDict()  # geometry -> map; the module's only state, a cache
_lock = Lock()


def _make(sonar: Sonar, size: int) -> FanMap:
    order = np.argsort(sonar.bearings, kind="stable")
    edges = beam_edges(sonar.bearings[order], sonar.beam_width)
    reach = sonar.bin_count * sonar.bin_length
    extent = _bounding_box(edges[0], edges[-1], reach)
    x, y = _pixel_centres(extent, size)
    distance = np.hypot(x, y)
    bearing = edges[0] + np.mod(np.arctan2(y, x) - edges[0], _TURN)
    bin_ = np.floor(distance / sonar.bin_length).astype(np.int64)
    place = np.searchsorted(edges, bearing, side="right") - 1
    inside = (bin_ < sonar.bin_count) & (place < order.size)
    beam = order[np.minimum(place, order.size - 1)]
    index = np.where(inside, beam * sonar.bin_count + bin_, -1)
    return FanMap(
        beam=_fractional_beam(sonar.bearings, order, bearing).astype(np.float32),
        bin=(distance / sonar.bin_length - 0.5).astype(np.float32),
        index=index.astype(np.int32),
        extent=extent,
    )


def _fractional_beam(
    bearings: NDArray[np.float64], order: NDArray[np.intp], at: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Index of a bearing among the beam centres; only a table sorted one way can be interpolated in."""
    rising = bool((np.diff(order) == 1).all())
    falling = bool((np.diff(order) == -1).all())
    place = np.interp(at, bearings[order], np.arange(order.size))
    if rising:
        return place
    if falling:
        return order.size - 1 - place
    return order[np.rint(place).astype(np.intp)].astype(np.float64)


def _bounding_box(first: float, last: float, reach: float) -> tuple[float, float, float, float]:
    """Left, right, bottom, top [m] of a sector from bearing ``first`` to ``last`` [rad], its apex included."""
    corners = [first, last]
    # The arc's outermost points ahead, left, behind and right, where the sector holds them.
    corners += [q for q in np.arange(np.ceil(first / (np.pi / 2)), last / (np.pi / 2) + 1) * (np.pi / 2) if q <= last]
    x, y = np.append(reach * np.cos(corners), 0.0), np.append(reach * np.sin(corners), 0.0)
    return float(y.max()), float(y.min()), float(x.min()), float(x.max())


def _pixel_centres(
    extent: tuple[float, float, float, float], size: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Forward and left coordinate [m] of each pixel's centre, as a column and a row that broadcast."""
    left, right, bottom, top = extent
    pixel = max(left - right, top - bottom) / size
    rows, columns = max(1, round((top - bottom) / pixel)), max(1, round((left - right) / pixel))
    x = top - (np.arange(rows) + 0.5) * (top - bottom) / rows
    y = left - (np.arange(columns) + 0.5) * (left - right) / columns
    return x[:, None], y[None, :]
