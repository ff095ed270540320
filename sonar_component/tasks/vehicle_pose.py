"""VehiclePoseTask: where the vehicle is, as a function of time."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from sonar_component.middleware.ports import OutputPort
from sonar_component.middleware.task import NoProperties, Periodic, Task
from sonar_component.samples.rigid_body_state import RigidBodyState
from sonar_component.settings.quantity import Angle, Length, Speed
from sonar_component.tasks.trajectory import Circle, FixedPose, LawnMower, Trajectory

Finite = Field(allow_inf_nan=False)
Coordinate = Annotated[Length, Finite]
Rotation = Annotated[Angle, Finite]


class CircleProperties(BaseModel):
    """A level circle around ``position``."""

    model_config = ConfigDict(extra="forbid")
    kind: Literal["circle"] = "circle"
    radius: Annotated[Length, Field(gt=0)] = 5.0
    speed: Annotated[Speed, Field(gt=0)] = 0.5
    look: Literal["ahead", "inwards"] = "inwards"


class LawnMowerProperties(BaseModel):
    """Parallel lines from ``position`` on, along the X and Y of ``rpy``'s yaw."""

    model_config = ConfigDict(extra="forbid")
    kind: Literal["lawn_mower"]
    length: Annotated[Length, Field(gt=0)] = 20.0
    spacing: Annotated[Length, Field(gt=0)] = 4.0
    lines: Annotated[int, Field(ge=1)] = 4
    speed: Annotated[Speed, Field(gt=0)] = 0.5


class VehiclePoseProperties(NoProperties):
    """What can be set."""

    position: tuple[Coordinate, Coordinate, Coordinate] = Field(
        (0.0, 0.0, 0.0), description="start, or centre of the circle [m]"
    )
    rpy: tuple[Rotation, Rotation, Rotation] = Field(
        (0.0, 0.0, 0.0), description="roll, pitch, yaw; positive pitch is nose down"
    )
    trajectory: Annotated[CircleProperties | LawnMowerProperties, Field(discriminator="kind")] | None = Field(
        None, description="circle or lawn_mower; none: the vehicle stays where it is"
    )
    frame: str = Field("vehicle", description="sourceFrame of the samples")
    world_frame: str = Field("world", description="targetFrame of the samples")


class VehiclePoseTask(Task):
    """Publishes the vehicle's pose at a steady rate."""

    Properties = VehiclePoseProperties
    dynamic = frozenset({"position", "rpy", "trajectory"})
    activity = Periodic(0.02)

    pose_samples: OutputPort[RigidBodyState] = OutputPort(RigidBodyState, doc="Pose and velocity in the world.")

    def configure_hook(self) -> bool | None:
        """Build the trajectory."""
        self._trajectory = trajectory_of(self.properties)
        return True

    def start_hook(self) -> bool | None:
        """The trajectory begins now."""
        self._began = self.now()
        return True

    def property_hook(self, name: str, value: Any) -> None:
        """A new place or trajectory begins where its own time is now."""
        self._trajectory = trajectory_of(self.properties.model_copy(update={name: value}))

    def update_hook(self) -> None:
        """One pose."""
        now = self.now()
        state = self._trajectory.at((now - self._began) * 1e-6)
        state.time, state.sourceFrame, state.targetFrame = now, self.properties.frame, self.properties.world_frame
        state.cov_position, state.cov_orientation = np.zeros((3, 3)), np.zeros((3, 3))
        self.pose_samples.write(state)


def trajectory_of(properties: VehiclePoseProperties) -> Trajectory:
    """The trajectory that the properties describe."""
    start, path = FixedPose(properties.position, properties.rpy), properties.trajectory
    if isinstance(path, CircleProperties):
        return Circle(start, path.radius, path.speed, path.look == "inwards")
    if isinstance(path, LawnMowerProperties):
        return LawnMower(start, path.length, path.spacing, path.lines, path.speed)
    return start
