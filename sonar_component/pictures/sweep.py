"""A scanning sonar's beams, one at a time -> the picture of a turn that fills and is overwritten.

Decision: a turn is kept as 800 slots of 0.45 degrees (half a gradian: the finest step of the scanning sonars we stand
in for is 0.45 degrees), each holding the last beam that looked there. A list of beams by their own bearing would be
exact for one step size, but grows without end when the step does not divide the turn, and old and new beams would lie
on top of each other.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sonar_component.samples import Sonar

SLOTS = 800  # [-] per turn
_TURN = 2 * np.pi  # [rad]
_SLOT = _TURN / SLOTS  # [rad]


@dataclass
class Sweep:
    """The last beam seen in each direction.

    Attributes
    ----------
    bins : (800, bin_count) float32
        Echo strength; NaN where the head has not been since the settings changed. Slot s looks at bearing
        ``slot_bearings()[s]``.
    bearings : (800,) float64
        Bearing of the beam that each slot holds [rad]; NaN where none.
    head : float
        Bearing of the last beam [rad]; NaN before the first.
    restarts : int
        How often the sweep was begun anew because a beam of another shape came.
    """

    bins: NDArray[np.float32] = field(default_factory=lambda: np.zeros((SLOTS, 0), np.float32))
    bearings: NDArray[np.float64] = field(default_factory=lambda: np.full(SLOTS, np.nan))
    head: float = float("nan")
    restarts: int = -1
    _last: Sonar | None = None

    def add(self, beam: Sonar) -> NDArray[np.intp]:
        """Put a message's beams into the sweep.

        Parameters
        ----------
        beam : Sonar
            One beam or a few; a change of bin_count or bin length begins the sweep anew.

        Returns
        -------
        (n,) intp
            The slots that changed, in order of bearing.

        Raises
        ------
        ValueError
            If the sample's fields do not fit together.
        """
        beam.validate()
        if self._last is None or self._geometry(self._last) != self._geometry(beam):
            self._begin(beam.bin_count)
        changed = [self._put(float(bearing), beam, row) for row, bearing in enumerate(beam.bearings)]
        self._last = beam
        return np.concatenate(changed) if changed else np.zeros(0, np.intp)

    def as_sonar(self) -> Sonar:
        """The whole turn as one image of 800 beams; slots not seen yet are NaN.

        Raises
        ------
        ValueError
            If no beam came yet.
        """
        if self._last is None:
            raise ValueError("the sweep holds no beam yet")
        last = self._last
        return Sonar(
            time=last.time,
            bin_duration=last.bin_duration,
            beam_width=_TURN,
            beam_height=last.beam_height,
            bearings=slot_bearings(),
            speed_of_sound=last.speed_of_sound,
            bin_count=last.bin_count,
            beam_count=SLOTS,
            bins=self.bins.copy(),
            frame=last.frame,
            sensor_position=last.sensor_position,
            sensor_orientation=last.sensor_orientation,
        )

    @staticmethod
    def _geometry(beam: Sonar) -> tuple[int, float, float]:
        return beam.bin_count, beam.bin_duration, beam.speed_of_sound

    def _begin(self, bin_count: int) -> None:
        self.bins = np.full((SLOTS, bin_count), np.nan, np.float32)
        self.bearings = np.full(SLOTS, np.nan)
        self.head = float("nan")
        self.restarts += 1

    def _put(self, bearing: float, beam: Sonar, row: int) -> NDArray[np.intp]:
        """Fill the slots from half a step before to half a step behind the bearing."""
        half = self._step(bearing, beam) / 2
        first, last = _slot_edge(bearing - half), _slot_edge(bearing + half)
        slots = np.arange(first, max(last, first + 1)) % SLOTS
        self.bins[slots] = beam.bins[row]
        self.bearings[slots] = bearing
        self.head = bearing
        return slots

    def _step(self, bearing: float, beam: Sonar) -> float:
        """Angle that this beam stands for [rad]: the motor's step, but never more than the beam is wide.

        A head that steps farther than its beam is wide leaves gaps in the world, and the picture shows them.
        """
        width = beam.beam_width / max(beam.beam_count, 1) if beam.beam_width > 0 else _SLOT
        moved = abs((bearing - self.head + np.pi) % _TURN - np.pi)
        return float(np.clip(moved, _SLOT, max(width, _SLOT))) if np.isfinite(moved) else max(width, _SLOT)


def _slot_edge(bearing: float) -> int:
    """Number of the slot edge nearest to a bearing [rad].

    The millionth of a slot keeps two beams that meet in the middle of a slot from both leaving it out.
    """
    return int(np.floor(bearing / _SLOT + 0.5 + 1e-6))


def slot_bearings() -> NDArray[np.float64]:
    """Bearing of the middle of each slot [rad], (800,) float64, rising from half a slot to just under a turn."""
    return np.asarray((np.arange(SLOTS) + 0.5) * _SLOT, np.float64)
