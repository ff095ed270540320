"""Tasks that look from outside as Rock's drivers of sonars do, with no device behind them: an FLS, and the Micron.

They ping on their own (a driver reads no pose), have the port and the property names that drivers and simulator share,
and see one thing: a wall across their way. So a deployment can be written and tried with a driver in it, and then have
its ``type:`` changed to MultibeamSonarTask or ScanningSonarTask, or to the driver, with nothing else touched.
"""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from sonar_component.middleware.ports import OutputPort
from sonar_component.middleware.task import NoProperties, Periodic, Task
from sonar_component.samples import Sonar
from sonar_component.samples.sonar import SPEED_OF_SOUND
from sonar_component.settings.quantity import Angle, Length, Ratio, Speed
from sonar_component.tasks.micron_config import MicronConfig

_DEG = math.pi / 180


class DriverStandInProperties(NoProperties):
    """Names and defaults of Rock's drivers and of the simulator."""

    range: Annotated[Length, Field(gt=0)] = Field(30.0, description="end of the last bin")
    gain: Annotated[Ratio, Field(ge=0, le=1)] = Field(0.5, description="0.5 is unity")
    bin_count: Annotated[int, Field(ge=1, le=4096)] = Field(default=500, description="bins along the range")
    beam_count: Annotated[int, Field(ge=1, le=4096)] = Field(default=256, description="beams across the fan")
    beam_width: Annotated[Angle, Field(gt=0)] = Field(default=120 * _DEG, description="opening of the fan in azimuth")
    beam_height: Annotated[Angle, Field(gt=0)] = Field(default=20 * _DEG, description="opening in elevation")
    speed_of_sound: Annotated[Speed, Field(gt=0)] = Field(default=SPEED_OF_SOUND, description="of the water")
    frame: str = Field(default="sonar", description="name of the sensor's frame in its samples")


class DriverStandInTask(Task):
    """A driver's outside around a wall 10 m ahead."""

    WALL = 10.0  # [m], ahead, square to the way ahead

    Properties = DriverStandInProperties
    dynamic = frozenset({"range", "gain"})
    activity = Periodic(0.1)

    sonar_samples: OutputPort[Sonar] = OutputPort(Sonar, queue=8, doc="One image per ping.")

    def update_hook(self) -> None:
        """One ping."""
        if self.sonar_samples.connected():
            self.sonar_samples.write(wall_image(self.properties, self.WALL, self.now()))


class MicronStandInProperties(NoProperties):
    """What Rock's driver of the Micron has: one structure."""

    config: MicronConfig = Field(
        default_factory=lambda: MicronConfig.model_validate({}),
        description="all of it in the words of Rock's driver of the Micron",
    )


class MicronStandInTask(Task):
    """The outside of Rock's driver of the Micron, a scanning sonar, around the same wall: one beam per ping."""

    WALL = DriverStandInTask.WALL  # [m]
    BEAM = (3 * _DEG, 35 * _DEG)  # [rad], width and height by the maker's sheet

    Properties = MicronStandInProperties
    activity = Periodic(0.1)

    sonar_samples: OutputPort[Sonar] = OutputPort(Sonar, queue=8, doc="One beam per ping.")

    def start_hook(self) -> bool | None:
        """The head begins at the right limit and turns counter-clockwise, as the simulator's does."""
        config = self.properties.config
        self._turn = Turn(config.right_limit, config.left_limit, config.angular_resolution, config.continous)
        return True

    def update_hook(self) -> None:
        """One beam."""
        bearing = self._turn.bearing
        self._turn.advance()
        if self.sonar_samples.connected():
            self.sonar_samples.write(wall_beam(self.properties.config, bearing, self.WALL, self.now(), self.BEAM))


class Turn:
    """Where the head looks: on and on, or back and forth between two limits."""

    def __init__(self, begin: float, end: float, step: float, continuous: bool) -> None:
        self._begin, self._width = begin, (end - begin) % (2 * math.pi) or 2 * math.pi
        self._step, self._continuous = step, continuous
        self._offset = -begin if continuous else 0.0  # a head that turns for ever begins ahead

    @property
    def bearing(self) -> float:
        """[rad], in -pi to pi."""
        return math.remainder(self._begin + self._offset, 2 * math.pi)

    def advance(self) -> None:
        """One step on."""
        self._offset += self._step
        if not self._continuous and not 0 <= self._offset <= self._width:
            self._offset = min(max(self._offset, 0.0), self._width)
            self._step = -self._step


def wall_beam(config: MicronConfig, bearing: float, wall: float, time: int, beam: tuple[float, float]) -> Sonar:
    """One beam on the wall, with its echo in the bin of range wall / cos(bearing)."""
    bins: NDArray[np.float32] = np.zeros((1, config.bin_count), np.float32)
    echo = wall / math.cos(bearing) if math.cos(bearing) > 0 else math.inf
    if config.min_distance <= echo < config.max_distance:
        bins[0, int(echo / config.max_distance * config.bin_count)] = min(1.0, 2 * config.gain)
    return Sonar(
        time=time, bin_duration=config.max_distance / config.bin_count / config.speed_of_sound, beam_width=beam[0],
        beam_height=beam[1], bearings=np.array([bearing]), speed_of_sound=config.speed_of_sound,
        bin_count=config.bin_count, beam_count=1, bins=bins, frame="sonar",
    )  # fmt: skip


def wall_image(properties: Any, wall: float, time: int) -> Sonar:
    """The image of a wall: at bearing b its echo lies in the bin of range wall / cos(b).

    Parameters
    ----------
    wall : distance of the wall along X [m].
    time : data time [us].
    """
    p = properties
    bearings = p.beam_width * (0.5 - (np.arange(p.beam_count) + 0.5) / p.beam_count)
    bins: NDArray[np.float32] = np.zeros((p.beam_count, p.bin_count), np.float32)
    ahead = np.cos(bearings) > 0
    ranges = np.full(p.beam_count, np.inf)
    ranges[ahead] = wall / np.cos(bearings[ahead])
    seen = np.flatnonzero(ranges < p.range)
    bins[seen, (ranges[seen] / p.range * p.bin_count).astype(int)] = min(1.0, 2 * p.gain)
    return Sonar(
        time=time, bin_duration=p.range / p.bin_count / p.speed_of_sound, beam_width=p.beam_width,
        beam_height=p.beam_height, bearings=bearings, speed_of_sound=p.speed_of_sound, bin_count=p.bin_count,
        beam_count=p.beam_count, bins=bins, frame=p.frame,
    )  # fmt: skip
