"""A sonar image, after Rock's base::samples::Sonar.

Two rules differ from the original simulator, whose frames broke base-types' own definitions: ``bearings`` are beam
centres and positive to the left, and ``bin_duration`` is kept as a float, since whole microseconds shift echoes by
up to 2.7 %.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

SPEED_OF_SOUND = 1497.0  # [m/s], base-types' default for water


def _unknown(*shape: int) -> NDArray[np.float64]:
    return np.full(shape, np.nan)


@dataclass
class Sonar:
    """Echo strengths of one ping (or one scan), beams x bins.

    Attributes
    ----------
    time : int
        When the data was true in the world [us]: the time of the pose that was rendered.
    timestamps : (beam_count,) or (0,) int64
        Time of each beam [us] where beams differ, else empty.
    bin_duration : float
        One-way travel time of a bin [s]: bin i begins at range ``i * bin_duration * speed_of_sound``.
    beam_width, beam_height : float
        Opening of the whole fan in azimuth and in elevation [rad], as Rock's simulator and BlueView driver use them.
    bearings : (beam_count,) float64
        Beam centres [rad], 0 ahead, positive to the left.
    speed_of_sound : float
        [m/s].
    bin_count, beam_count : int
        Shape of ``bins``.
    bins : (beam_count, bin_count) float32
        Echo strength, linear, gain-corrected; NaN where nothing was measured.
    frame : str
        The sensor's frame; base-types leaves it out, and without it an image cannot be placed in the world.
    sensor_position, sensor_orientation : (3,), (4,) float64
        Pose of that frame in the world [m], quaternion (w, x, y, z); NaN if not known.
    """

    time: int = 0
    timestamps: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    bin_duration: float = float("nan")
    beam_width: float = float("nan")
    beam_height: float = float("nan")
    bearings: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    speed_of_sound: float = SPEED_OF_SOUND
    bin_count: int = 0
    beam_count: int = 0
    bins: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 0), np.float32))
    frame: str = ""
    sensor_position: NDArray[np.float64] = field(default_factory=lambda: _unknown(3))
    sensor_orientation: NDArray[np.float64] = field(default_factory=lambda: _unknown(4))

    def validate(self) -> None:
        """Raise ValueError naming the first field that does not fit the others."""
        if self.bins.shape != (self.beam_count, self.bin_count):
            raise ValueError(f"bins must be ({self.beam_count}, {self.bin_count}) beams x bins, got {self.bins.shape}")
        if self.bearings.shape != (self.beam_count,):
            raise ValueError(f"bearings must hold {self.beam_count} beam centres, got {self.bearings.shape}")
        if self.timestamps.size and self.timestamps.shape != (self.beam_count,):
            raise ValueError(f"timestamps must be empty or one per beam, got {self.timestamps.shape}")
        for name in ("bin_duration", "speed_of_sound"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be above 0, got {getattr(self, name)}")

    @property
    def bin_length(self) -> float:
        """Extent of one bin in range [m]."""
        return self.bin_duration * self.speed_of_sound

    def bin_ranges(self) -> NDArray[np.float64]:
        """Range of the middle of each bin.

        Returns
        -------
        (bin_count,) float64 [m]
        """
        return (np.arange(self.bin_count, dtype=np.float64) + 0.5) * self.bin_length
