"""VehiclePoseTask: where the vehicle is, at a steady rate.

What moves it is what is connected: `pose_cmd`, a real vehicle or another simulator; else `velocity_cmd`, an operator or
a controller; else its own trajectory. A property that chooses was the alternative, and could contradict the graph.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from sonar_component.middleware.ports import InputPort, InvalidSampleError, OutputPort
from sonar_component.middleware.task import INVALID_INPUT, STALE_INPUT, Periodic, Task
from sonar_component.samples import LinearAngular6DCommand, RigidBodyState
from sonar_component.samples.motion import carried_on
from sonar_component.samples.rigid_body_state import quaternion_from_rpy
from sonar_component.settings import SettingsError
from sonar_component.tasks.commanded import CommandedVehicle
from sonar_component.tasks.pose_track import PoseTrack
from sonar_component.tasks.vehicle_properties import VehiclePoseProperties, trajectory_of

NO_POSE, NO_COMMAND = "NO_POSE", "NO_COMMAND"
_LONGEST_STEP = 1.0  # [s], of the commanded vehicle: a task that was held up does not leap


class VehiclePoseTask(Task):
    """Publishes the vehicle's pose at a steady rate."""

    Properties = VehiclePoseProperties
    dynamic = frozenset({"position", "rpy", "trajectory", "commanded", "outside"})
    activity = Periodic(0.02)

    pose_cmd: InputPort[RigidBodyState] = InputPort(RigidBodyState, doc="Pose from outside: then the vehicle is there.")
    velocity_cmd: InputPort[LinearAngular6DCommand] = InputPort(
        LinearAngular6DCommand, doc="Velocities in the vehicle's frame: then it follows them."
    )
    pose_samples: OutputPort[RigidBodyState] = OutputPort(RigidBodyState, doc="Pose and velocity in the world.")

    @classmethod
    def check(cls, properties: Any, beside: str | Path | None) -> list[tuple[str, str]]:
        """A trajectory's file must be there and good."""
        try:
            trajectory_of(properties, beside)
        except SettingsError as error:
            return [("trajectory", str(error))]
        return []

    def configure_hook(self) -> bool | None:
        """Build the trajectory."""
        try:
            self._trajectory = trajectory_of(self.properties, self.beside)
        except SettingsError as error:
            return self.refuse(str(error))
        return True

    def start_hook(self) -> bool | None:
        """Everything begins now."""
        if self.pose_cmd.connected() and self.velocity_cmd.connected():
            return self.refuse("pose_cmd and velocity_cmd are both connected: only one can move the vehicle")
        p = self.properties
        self._began = self._last = self.now()
        self._led_by = ""
        self._track = PoseTrack(p.outside.max_age, p.outside.max_speed, p.outside.max_turn_rate)
        self._command: LinearAngular6DCommand | None = None
        self._commanded_at = self._began
        self._vehicle = self._new_vehicle(p)
        return True

    def property_hook(self, name: str, value: Any) -> None:
        """A new place or trajectory begins where its own time is now; a commanded vehicle goes on from a new place."""
        changed = self.properties.model_copy(update={name: value})
        if name == "outside":
            self._track = PoseTrack(value.max_age, value.max_speed, value.max_turn_rate)
        elif name == "commanded":
            v = self._vehicle
            v.max_speed, v.max_turn_rate, v.lag = value.max_speed, value.max_turn_rate, value.lag
        else:
            self._trajectory = trajectory_of(changed, self.beside)
            if name != "trajectory":
                self._vehicle = self._new_vehicle(changed)

    def update_hook(self) -> None:
        """One pose."""
        now = self.now()
        if self.pose_cmd.connected() or self._led_by == "pose_cmd":
            self._led_by = "pose_cmd"
            state = self._from_outside(now)
        elif self.velocity_cmd.connected() or self._led_by == "velocity_cmd":
            self._led_by = "velocity_cmd"
            state = self._commanded(now)
        else:
            state = self._trajectory.at((now - self._began) * 1e-6)
            state.time = now
            state.cov_position, state.cov_orientation = np.zeros((3, 3)), np.zeros((3, 3))
        self._last = now
        if state is not None:
            state.sourceFrame, state.targetFrame = self.properties.frame, self.properties.world_frame
            self.pose_samples.write(state)

    def _from_outside(self, now: int) -> RigidBodyState | None:
        """The newest pose that came since the last cycle, with the velocity that led to it where it has none."""
        try:
            fresh = self._take_poses()
        except InvalidSampleError:
            raise
        except ValueError as error:
            self.error(INVALID_INPUT, f"{self.pose_cmd.full_name}: {error}", self.pose_cmd)
            return None
        newest = self._track.newest
        if newest is None:
            self.note(NO_POSE, f"waits for a pose on {self.pose_cmd.full_name}")
            return None
        age, allowed = (now - newest.time) * 1e-6, self.properties.outside.max_age
        if age > allowed:
            reason = f"{self.pose_cmd.full_name}: the last pose is {age:.2f} s old, allowed {allowed:g} s"
            self.error(STALE_INPUT, reason, self.pose_cmd)
            return None
        self.note("")
        if not fresh:
            return None
        measured = self._track.at(newest.time)
        state = carried_on(newest, newest.time)
        for name in ("velocity", "angular_velocity"):
            if np.isnan(getattr(newest, name)).any():
                setattr(state, name, getattr(measured, name))
        state.cov_position, state.cov_orientation = newest.cov_position, newest.cov_orientation
        return state

    def _take_poses(self) -> bool:
        """Whether a new pose came; ValueError says what speaks against one."""
        fresh = False
        while (pose := self.pose_cmd.read_new()) is not None:
            fresh |= self._track.add(pose)
        return fresh

    def _commanded(self, now: int) -> RigidBodyState:
        """Where the command of the last cycle has led."""
        while (command := self.velocity_cmd.read_new()) is not None:
            self._command, self._commanded_at = command, now
        silence, allowed = (now - self._commanded_at) * 1e-6, self.properties.commanded.timeout
        if silence > allowed:
            self._command = None
        if self._command is None:
            self.note(NO_COMMAND, f"no command for {allowed:g} s: comes to rest" if silence > allowed else "")
        else:
            self.note("")
        state = self._vehicle.advance(self._command, min((now - self._last) * 1e-6, _LONGEST_STEP))
        state.time = now
        return state

    @staticmethod
    def _new_vehicle(properties: VehiclePoseProperties) -> CommandedVehicle:
        p = properties
        orientation = quaternion_from_rpy(*p.rpy)
        return CommandedVehicle(
            np.array(p.position), orientation, p.commanded.max_speed, p.commanded.max_turn_rate, p.commanded.lag
        )
