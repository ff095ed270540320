"""The ``config`` property of Rock's driver of the Tritech Micron, and what it means to the simulator.

The driver's head turns from the left limit to the right one, both counted counter-clockwise from ahead; ours begins at
left_limit and goes the way bearings grow. So the two limits change places.
"""

from __future__ import annotations

import math
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from sonar_component.settings.quantity import Angle, Length, Ratio, Speed

Limit = Annotated[Angle, Field(ge=-math.pi, le=math.pi)]


class MicronConfig(BaseModel):
    """Names and defaults of sea_net's MicronConfig, its spelling of ``continous`` included."""

    model_config = ConfigDict(extra="forbid", validate_default=True, defer_build=True)

    left_limit: Limit = Field(math.pi, description="where a sector begins, left positive")
    right_limit: Limit = Field(-math.pi, description="where it ends")
    angular_resolution: Annotated[Angle, Field(gt=0)] = Field(math.radians(5.0), description="between two beams")
    max_distance: Annotated[Length, Field(gt=0)] = Field(15.0, description="end of the last bin")
    min_distance: Annotated[Length, Field(ge=0)] = Field(1.0, description="nearer echoes are left out")
    resolution: Annotated[Length, Field(gt=0)] = Field(0.1, description="length of a bin")
    speed_of_sound: Annotated[Speed, Field(gt=0)] = 1500.0
    gain: Annotated[Ratio, Field(ge=0, le=1)] = 0.4
    low_resolution: bool = Field(False, description="4 bits an echo from the device; the simulator's stay whole")
    continous: bool = Field(True, description="turn for ever; otherwise back and forth between the limits")
    invert: bool = Field(False, description="the device hangs upside down; bearings are given upright all the same")

    @property
    def bin_count(self) -> int:
        """Bins of one beam."""
        return max(1, round(self.max_distance / self.resolution))

    def settings(self) -> dict[str, Any]:
        """The same in the properties of ScanningSonarTask."""
        return {
            "range": self.max_distance, "min_range": self.min_distance, "bin_count": self.bin_count,
            "motor_step": self.angular_resolution, "left_limit": self.right_limit, "right_limit": self.left_limit,
            "continuous": self.continous, "gain": self.gain, "speed_of_sound": self.speed_of_sound,
        }  # fmt: skip


def with_config(values: Any) -> Any:
    """Properties with what their ``config`` says; what stands beside it has precedence."""
    given = values.get("config") if isinstance(values, dict) else None
    if given is None:
        return values
    try:
        config = MicronConfig.model_validate(given)
    except ValidationError:
        return values  # the field itself tells what is wrong, and where
    return {**config.settings(), **values}
