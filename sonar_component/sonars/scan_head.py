"""The head of a scanning sonar: where it looks in each ping.

Bearings grow counter-clockwise, to the left. In a sector the head goes over a fixed row of places: one at
``start_bearing``, others a step apart on both sides of it, and one on each limit, so that a step that does not divide
the sector is shortened at its end only. The row is walked back and forth, which measures a limit once per turn-back;
the original simulator measures it twice. Turning for ever has no such row: like a motor, the head goes on by its step
and begins the next turn wherever that leads.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sonar_component.sonars.scanning_settings import ScanningSettings

_TURN = 2 * math.pi  # [rad]
_SAME = 1e-9  # [rad], differences below it come from converting degrees


class ScanHead:
    """Walks over the bearings of a sector.

    Attributes
    ----------
    bearing : float
        Where the head looks now [rad], in (-pi, pi].
    place, places : int
        Number of that direction, counted counter-clockwise, and how many there are: a beam of the next turn at the same
        place takes over from the one before.
    """

    def __init__(self, settings: ScanningSettings) -> None:
        self._continuous, self._step = settings.continuous, settings.motor_step
        self._aside: float | None = None
        start = settings.start_bearing
        if self._continuous:
            self._start, self._steps = start or 0.0, 0
            self.places = math.ceil(_TURN / self._step - _SAME)
            return
        self._row = _row(settings.sector, self._step, settings.offset(start) if start is not None else 0.0)
        self._left = settings.left_limit
        self.places = len(self._row)
        offset = settings.offset(start) if start is not None else 0.0
        self._index, self._direction = int(np.abs(self._row - offset).argmin()), 1

    @property
    def bearing(self) -> float:
        """Where the head looks [rad], in (-pi, pi]."""
        return wrapped(self._unwrapped())

    @property
    def place(self) -> int:
        """Number of the direction in which it looks."""
        if not self._continuous:
            return self._index
        return min(int(((self._unwrapped() + math.pi) % _TURN) / self._step + _SAME), self.places - 1)

    def advance(self) -> bool:
        """Go on by one ping; True where a scan ends with the place just left: at a limit, or after a full turn."""
        self._aside = None
        if self._continuous:
            self._steps += 1
            return self._steps % self.places == 0
        at_limit = not 0 <= self._index + self._direction < self.places
        if at_limit:
            self._direction = -self._direction
        self._index += self._direction
        return at_limit

    def skip(self, pings: int) -> None:
        """Turn on by as many pings that nobody hears."""
        if self._continuous:
            self._steps += pings
            return
        for _ in range(pings % max(2 * (self.places - 1), 1)):
            self.advance()

    def bearings(self) -> NDArray[np.float64]:
        """(places,) float64: the bearings of all places [rad], growing, so that a sector may go beyond pi."""
        if self._continuous:
            return np.asarray(-math.pi + np.arange(self.places) * self._step)
        return self._left + self._row

    def look_at(self, bearing: float, exactly: bool = False) -> None:
        """Go to the place nearest to a bearing [rad]; `exactly` there, for a ping beside all places."""
        self._aside = bearing if exactly else None
        if self._continuous:
            self._start, self._steps = bearing, 0
            return
        away = np.abs((self.bearings() - bearing + math.pi) % _TURN - math.pi)
        self._index = int(away.argmin())

    def _unwrapped(self) -> float:
        if self._aside is not None:
            return self._aside
        if self._continuous:
            return self._start + self._steps * self._step
        return float(self._left + self._row[self._index])


def _row(sector: float, step: float, start: float) -> NDArray[np.float64]:
    """Places of a sector as offsets from its first limit [rad]: the limits, `start`, and steps on both sides of it."""
    below = start - step * np.arange(math.floor(start / step + _SAME), 0, -1)
    above = start + step * np.arange(math.floor((sector - start) / step + _SAME) + 1)
    row = np.concatenate([[0.0], below, above, [sector]])
    row = row[np.concatenate([[True], np.diff(row) > _SAME])]
    if sector > _TURN - _SAME:  # both limits are the same direction, and that is measured once
        row = row[:-1]
    return np.asarray(row)


def wrapped(bearing: float) -> float:
    """The same direction in (-pi, pi] [rad], as Rock's base::Angle keeps it."""
    inside = math.remainder(bearing, _TURN)
    return math.pi if inside <= -math.pi + _SAME else inside
