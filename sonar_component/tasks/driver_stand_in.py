"""DriverStandInTask: looks from outside as Rock's drivers of forward-looking sonars do, with no device behind it.

It pings on its own (a driver reads no pose), has the port and the property names that drivers and simulator share, and
sees one thing: a wall across its way. So a deployment can be written and tried with a driver in it, and then have its
``type:`` changed to MultibeamSonarTask, or to the driver, with nothing else touched.
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

_DEG = math.pi / 180


class DriverStandInProperties(NoProperties):
    """Names and defaults of Rock's drivers and of the simulator."""

    range: Annotated[Length, Field(gt=0)] = Field(30.0, description="end of the last bin")
    gain: Annotated[Ratio, Field(ge=0, le=1)] = Field(0.5, description="0.5 is unity")
    bin_count: Annotated[int, Field(ge=1, le=4096)] = 500
    beam_count: Annotated[int, Field(ge=1, le=4096)] = 256
    beam_width: Annotated[Angle, Field(gt=0)] = 120 * _DEG
    beam_height: Annotated[Angle, Field(gt=0)] = 20 * _DEG
    speed_of_sound: Annotated[Speed, Field(gt=0)] = SPEED_OF_SOUND
    frame: str = "sonar"


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
