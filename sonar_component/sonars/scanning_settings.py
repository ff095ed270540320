"""What a user sets on a scanning sonar: Rock's property names, and the pace of its head."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from sonar_component.echo import beams
from sonar_component.settings.quantity import Angle, AngularSpeed, Duration
from sonar_component.sonars.settings import SonarSettings

_DEG = math.pi / 180
_TURN = 2 * math.pi  # [rad]
_LEAST_STEP = 0.01 * _DEG  # [rad], a fortieth of the finest head we know; a smaller one would make endless scans
_GREATEST_STEP = 90 * _DEG  # [rad], no head does more than a few degrees, and 1.8 without its unit must not pass
_RADIANS = "; a number without a unit is in rad"
_SAME = 1e-9  # [rad], differences below it come from converting degrees


class ScanningSettings(SonarSettings):
    """Settings of a mechanically scanning sonar, in the words of Rock's ScanningSonarTask.

    The sector begins at left_limit and goes the way bearings grow, counter-clockwise seen from above, to right_limit,
    as in Rock's simulator. So -45 and 45 deg is the quarter ahead, and left_limit > right_limit is a sector through
    180 deg.
    """

    kind: Literal["scanning"] = Field(
        default="scanning", description="tells a settings file for this sonar from others"
    )
    beam_width: Angle = Field(default=3 * _DEG, description="opening of the beam in azimuth")
    beam_height: Angle = Field(default=35 * _DEG, description="opening of the beam in elevation")
    left_limit: Angle = Field(
        default=-math.pi,
        description="where the sector begins, -180 deg to 180 deg, left positive; it goes on counter-clockwise",
    )
    right_limit: Angle = Field(default=math.pi, description="where the sector ends, -180 deg to 180 deg, left positive")
    motor_step: Angle = Field(default=1.8 * _DEG, description="between two pings, at most the sector")
    continuous: bool = Field(default=True, description="turn for ever; otherwise back and forth between the limits")
    start_bearing: Angle | None = Field(
        default=None, description="where the first ping looks [rad]; none: left_limit, or 0 where continuous"
    )
    head_speed: Annotated[AngularSpeed, Field(gt=0, le=1000)] = Field(
        default=180 * _DEG, description="how fast the head turns between pings"
    )
    bin_time: Annotated[Duration, Field(ge=0, le=0.1)] = Field(
        default=0.0, description="what the device needs for each bin besides listening"
    )
    min_ping_period: Annotated[Duration, Field(ge=0, le=60)] = Field(
        default=0.0, description="the device pings no faster"
    )

    @field_validator("left_limit", "right_limit", "start_bearing")
    @classmethod
    def _is_a_direction(cls, value: float | None) -> float | None:
        if value is not None and not -math.pi - _SAME <= value <= math.pi + _SAME:
            raise ValueError(f"must be -180 deg to 180 deg, got {_degrees(value)}{_RADIANS}")
        return value

    @model_validator(mode="after")
    def _head_can_move(self) -> ScanningSettings:
        sector = self.sector
        if sector < _SAME:
            got = f"{_degrees(self.left_limit)} and {_degrees(self.right_limit)}"
            raise ValueError(f"left_limit and right_limit must differ: a sector has a width, got {got}")
        most = min(_GREATEST_STEP, sector)
        if not _LEAST_STEP - _SAME <= self.motor_step <= most + _SAME:
            width = " (the width of the sector)" if most < _GREATEST_STEP else ""
            allowed = f"{_degrees(_LEAST_STEP)} to {_degrees(most)}{width}"
            hint = _RADIANS if self.motor_step > _GREATEST_STEP else ""
            raise ValueError(f"motor_step must be {allowed}, got {_degrees(self.motor_step)}{hint}")
        if self.start_bearing is not None and self.offset(self.start_bearing) > sector + _SAME:
            allowed = f"from left_limit {_degrees(self.left_limit)} on to right_limit {_degrees(self.right_limit)}"
            raise ValueError(f"start_bearing must be in the sector, {allowed}, got {_degrees(self.start_bearing)}")
        return self

    @property
    def sector(self) -> float:
        """Width of what the head covers [rad]: a full turn where continuous."""
        if self.continuous:
            return _TURN
        span = self.right_limit - self.left_limit
        if abs(span - _TURN) < _SAME:
            return _TURN
        return 0.0 if abs(span) < _SAME or abs(span + _TURN) < _SAME else span % _TURN

    def offset(self, bearing: float) -> float:
        """How far a bearing lies beyond left_limit, counter-clockwise [rad], 0 to a turn."""
        beyond = (bearing - self.left_limit) % _TURN
        return 0.0 if _TURN - beyond < _SAME and not self.continuous else beyond

    @property
    def ping_period(self) -> float:
        """Time from ping to ping [s]: listen to the last bin, hand the bins over, turn the head."""
        listen = 2 * self.range / self.speed_of_sound
        turn = self.motor_step / self.head_speed
        return max(listen + self.bin_count * self.bin_time + turn, self.min_ping_period)

    def beam_table(self) -> beams.BeamTable:
        """The one beam, about the head's own axis."""
        return beams.equal_angle(1, self.beam_width, self.beam_height)


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle):.6g} deg"
