"""A full scan: the last beam heard at each place of a scanning head, each with its own time, for displays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sonar_component.samples import Sonar

_TURN = 2 * np.pi  # [rad]


class Scan:
    """Collects one-beam samples; a beam at the same place takes over from the one of the turn before.

    Parameters
    ----------
    bearings : (places,) float64
        Bearing of each place [rad], growing.
    step : float
        Width that a beam stands for [rad].
    """

    def __init__(self, bearings: NDArray[np.float64], step: float) -> None:
        self._bearings, self._step = np.array(bearings), step
        self._times = np.zeros(len(bearings), np.int64)
        self._bins: NDArray[np.float32] | None = None
        self._last: Sonar | None = None

    @property
    def filled(self) -> float:
        """Share of the places that have been heard [-]."""
        return float((self._times != 0).mean())

    def add(self, place: int, beam: Sonar) -> None:
        """Put a one-beam sample at a place; another number of bins begins the scan anew."""
        if self._bins is None or self._bins.shape[1] != beam.bin_count:
            self._bins = np.full((len(self._bearings), beam.bin_count), np.nan, np.float32)
            self._times[:] = 0
        self._bins[place] = beam.bins[0]
        self._times[place] = beam.time
        # A turn that its step does not divide comes by at another bearing of the same place each time.
        near = self._bearings[place]
        self._bearings[place] = near + (beam.bearings[0] - near + np.pi) % _TURN - np.pi
        self._last = beam

    def sample(self) -> Sonar:
        """The whole scan, leftmost beam first; a place not heard yet is NaN with timestamp 0.

        Bearings fall from beam to beam, so those of a sector through 180 deg go beyond it. The pose is that of the last
        beam: a vehicle that moves during a scan has one for each.

        Raises
        ------
        ValueError
            If nothing was heard yet.
        """
        if self._last is None or self._bins is None:
            raise ValueError("the scan holds no beam yet")
        last, count = self._last, len(self._bearings)
        width = min(float(self._bearings[-1] - self._bearings[0]) + self._step, _TURN)
        return Sonar(
            time=last.time,
            timestamps=self._times[::-1].copy(),
            bin_duration=last.bin_duration,
            beam_width=width,
            beam_height=last.beam_height,
            bearings=self._bearings[::-1].copy(),
            speed_of_sound=last.speed_of_sound,
            bin_count=last.bin_count,
            beam_count=count,
            bins=np.ascontiguousarray(self._bins[::-1]),
            frame=last.frame,
            sensor_position=last.sensor_position,
            sensor_orientation=last.sensor_orientation,
        )
