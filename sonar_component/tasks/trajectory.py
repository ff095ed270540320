"""Trajectories: time since the start [s] to pose and velocity, in closed form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sonar_component.samples.rigid_body_state import RigidBodyState, quaternion_from_rpy

Vector = NDArray[np.float64]


class Trajectory(Protocol):
    """A pose for every time."""

    def at(self, seconds: float) -> RigidBodyState:
        """Pose and velocity `seconds` after the start; time and frames are left to the caller."""


def _state(position: Vector, rpy: Sequence[float], velocity: Vector, yaw_rate: float) -> RigidBodyState:
    roll, pitch, yaw = rpy
    # The turn is about the world's Z; angular_velocity is in the body's axes.
    rate = yaw_rate * np.array([-np.sin(pitch), np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)])
    orientation = quaternion_from_rpy(roll, pitch, yaw)
    return RigidBodyState(position=position, orientation=orientation, velocity=velocity, angular_velocity=rate)


@dataclass(frozen=True)
class FixedPose:
    """The vehicle stays.

    Attributes
    ----------
    position : 3 numbers [m].
    rpy : roll, pitch, yaw [rad].
    """

    position: Sequence[float]
    rpy: Sequence[float]

    def at(self, seconds: float) -> RigidBodyState:
        """The same pose at every time."""
        return _state(np.array(self.position, np.float64), self.rpy, np.zeros(3), 0.0)


@dataclass(frozen=True)
class Circle:
    """A level circle, counterclockwise seen from above, around the start's position.

    It begins on the side that the start's yaw points away from, so that a vehicle looking inwards begins with that yaw.
    """

    start: FixedPose
    radius: float
    speed: float
    inwards: bool = True

    def at(self, seconds: float) -> RigidBodyState:
        """Pose and velocity on the circle."""
        roll, pitch, yaw = self.start.rpy
        rate = self.speed / self.radius
        bearing = yaw + np.pi + rate * seconds  # of the vehicle, seen from the centre
        outwards = np.array([np.cos(bearing), np.sin(bearing), 0.0])
        along = np.array([-np.sin(bearing), np.cos(bearing), 0.0])
        heading = bearing + (np.pi if self.inwards else np.pi / 2)
        position = np.array(self.start.position, np.float64) + self.radius * outwards
        return _state(position, (roll, pitch, heading), self.speed * along, rate)


@dataclass(frozen=True)
class LawnMower:
    """Parallel lines joined by half circles, then the same way back, for ever.

    The first line goes along the start's yaw; the next ones lie to its left.
    """

    start: FixedPose
    length: float
    spacing: float
    lines: int
    speed: float

    def at(self, seconds: float) -> RigidBodyState:
        """Pose and velocity on the pattern."""
        turn = np.pi * self.spacing / 2
        leg = self.length + turn
        total = self.lines * self.length + (self.lines - 1) * turn
        way = (self.speed * seconds) % (2 * total)
        back = way >= total
        way = 2 * total - way if back else way
        number = min(int(way // leg), self.lines - 1)
        p, heading = self._on_leg(number, way - number * leg)
        roll, pitch, yaw = self.start.rpy
        turning = way - number * leg > self.length
        left = 1.0 if number % 2 == 0 else -1.0
        rate = self.speed / (self.spacing / 2) * left if turning else 0.0
        if back:
            heading, rate = heading + np.pi, -rate
        R = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
        velocity = self.speed * np.array([np.cos(yaw + heading), np.sin(yaw + heading), 0.0])
        position = np.array(self.start.position, np.float64) + np.array([*(R @ p), 0.0])
        return _state(position, (roll, pitch, yaw + heading), velocity, rate)

    def _on_leg(self, number: int, way: float) -> tuple[Vector, float]:
        """Place in the pattern's own axes, and heading, `way` metres into a line and the turn after it."""
        outbound = number % 2 == 0
        y = number * self.spacing
        if way <= self.length:
            return np.array([way if outbound else self.length - way, y]), 0.0 if outbound else np.pi
        radius = self.spacing / 2
        angle = (way - self.length) / radius
        reach = radius * np.sin(angle)
        x = self.length + reach if outbound else -reach
        heading = angle if outbound else np.pi - angle
        return np.array([x, y + radius * (1 - np.cos(angle))]), heading


@dataclass(frozen=True)
class Inspection:
    """A helix around the start's position, looking at it: up to `height`, down again, for ever.

    It begins like ``Circle``, level with the start's position.
    """

    start: FixedPose
    radius: float
    height: float
    turns: float
    speed: float

    def at(self, seconds: float) -> RigidBodyState:
        """Pose and velocity on the helix."""
        around = 2 * np.pi * self.turns  # [rad], from end to end
        length = float(np.hypot(around * self.radius, self.height))
        way = (self.speed * seconds) % (2 * length)
        upwards = 1.0 if way < length else -1.0
        share = min(way, 2 * length - way) / length
        level = Circle(self.start, self.radius, self.radius * around * self.speed / length)
        state = level.at(share * length / self.speed)
        rise = np.array([0.0, 0.0, self.height])
        state.position = state.position + share * rise
        state.velocity = upwards * (state.velocity + self.speed / length * rise)
        state.angular_velocity = upwards * state.angular_velocity
        return state
