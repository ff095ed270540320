"""What can be set on VehiclePoseTask: where the vehicle begins, and what moves it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from sonar_component.middleware.task import NoProperties
from sonar_component.samples.rigid_body_state import quaternion_from_rpy, rotation_from_quaternion
from sonar_component.settings.paths import find_file
from sonar_component.settings.quantity import Angle, AngularSpeed, Duration, Length, Ratio, Speed
from sonar_component.tasks.trajectory import Circle, FixedPose, Inspection, LawnMower, Trajectory
from sonar_component.tasks.waypoint_file import read_waypoints
from sonar_component.tasks.waypoints import Waypoints, placed

Coordinate = Annotated[Length, Field(allow_inf_nan=False)]
Rotation = Annotated[Angle, Field(allow_inf_nan=False)]
Pace = Annotated[Speed, Field(gt=0, allow_inf_nan=False)]
Extent = Annotated[Length, Field(gt=0, allow_inf_nan=False)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", defer_build=True)


class CircleProperties(_Strict):
    """A level circle around ``position``."""

    kind: Literal["circle"] = "circle"
    radius: Extent = 5.0
    speed: Pace = 0.5
    look: Literal["ahead", "inwards"] = "inwards"


class LawnMowerProperties(_Strict):
    """Parallel lines from ``position`` on, along the X and Y of ``rpy``'s yaw."""

    kind: Literal["lawn_mower"]
    length: Extent = 20.0
    spacing: Extent = 4.0
    lines: Annotated[int, Field(ge=1)] = 4
    speed: Pace = 0.5


class InspectionProperties(_Strict):
    """A helix around ``position``, looking inwards: up to ``height``, down again."""

    kind: Literal["inspection"]
    radius: Extent = 4.0
    height: Extent = 4.0
    turns: Annotated[Ratio, Field(gt=0, le=1000)] = 3.0
    speed: Pace = 0.3


class FileProperties(_Strict):
    """Poses from a CSV or YAML file, in the frame that ``position`` and ``rpy`` give."""

    kind: Literal["file"]
    file: str
    interpolation: Literal["linear", "spline"] = "spline"
    at_end: Literal["hold", "repeat"] = "hold"
    max_gap: Annotated[Duration, Field(gt=0)] = 60.0


class CommandedProperties(_Strict):
    """How the vehicle follows ``velocity_cmd``."""

    max_speed: Pace = 2.0
    max_turn_rate: Annotated[AngularSpeed, Field(gt=0, allow_inf_nan=False)] = math.radians(45)
    lag: Annotated[Duration, Field(ge=0, le=60)] = 0.5
    timeout: Annotated[Duration, Field(gt=0)] = 1.0


class OutsideProperties(_Strict):
    """What is believed of ``pose_cmd``."""

    max_age: Annotated[Duration, Field(gt=0)] = 1.0
    max_speed: Pace = 10.0
    max_turn_rate: Annotated[AngularSpeed, Field(gt=0, allow_inf_nan=False)] = math.pi


Path_ = CircleProperties | LawnMowerProperties | InspectionProperties | FileProperties


class VehiclePoseProperties(NoProperties):
    """What can be set."""

    position: tuple[Coordinate, Coordinate, Coordinate] = Field(
        (0.0, 0.0, 0.0), description="start, or centre of the circle [m]"
    )
    rpy: tuple[Rotation, Rotation, Rotation] = Field(
        (0.0, 0.0, 0.0), description="roll, pitch, yaw; positive pitch is nose down"
    )
    trajectory: Annotated[Path_, Field(discriminator="kind")] | None = Field(
        None, description="circle, lawn_mower, inspection or file; none: the vehicle stays where it is"
    )
    commanded: CommandedProperties = Field(CommandedProperties(), description="limits and lag for velocity_cmd")
    outside: OutsideProperties = Field(OutsideProperties(), description="age and plausibility for pose_cmd")
    frame: str = Field("vehicle", description="sourceFrame of the samples")
    world_frame: str = Field("world", description="targetFrame of the samples")


def trajectory_of(properties: VehiclePoseProperties, beside: str | Path | None = None) -> Trajectory:
    """The trajectory that the properties describe.

    Raises
    ------
    SettingsError
        If its file is not there or wrong.
    """
    start, path = FixedPose(properties.position, properties.rpy), properties.trajectory
    if isinstance(path, CircleProperties):
        return Circle(start, path.radius, path.speed, path.look == "inwards")
    if isinstance(path, LawnMowerProperties):
        return LawnMower(start, path.length, path.spacing, path.lines, path.speed)
    if isinstance(path, InspectionProperties):
        return Inspection(start, path.radius, path.height, path.turns, path.speed)
    if isinstance(path, FileProperties):
        return _from_file(properties, path, beside)
    return start


def _from_file(properties: VehiclePoseProperties, path: FileProperties, beside: str | Path | None) -> Waypoints:
    times, positions, orientations = read_waypoints(find_file(path.file, beside), path.max_gap)
    q_WT = quaternion_from_rpy(*properties.rpy)
    X_WT = np.eye(4)
    X_WT[:3, :3], X_WT[:3, 3] = rotation_from_quaternion(q_WT), properties.position
    return Waypoints(times, *placed((positions, orientations), X_WT, q_WT), path.interpolation, path.at_end)
