"""A vehicle that follows velocity commands: limits, and a first-order lag towards what is commanded."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sonar_component.samples import LinearAngular6DCommand, RigidBodyState
from sonar_component.samples.motion import exponential, product
from sonar_component.samples.rigid_body_state import rotation_from_quaternion

Array = NDArray[np.float64]


class CommandedVehicle:
    """Integrates body velocities.

    Parameters
    ----------
    position, orientation : (3,), (4,) float64
        Where it begins [m], (w, x, y, z).
    max_speed, max_turn_rate : float
        A faster command is scaled down to it, its direction kept [m/s, rad/s].
    lag : float
        Time in which the velocity covers 63 % of the way to the command [s]; 0 follows at once.
    """

    def __init__(self, position: Array, orientation: Array, max_speed: float, max_turn_rate: float, lag: float) -> None:
        self.position, self.orientation = np.array(position, np.float64), np.array(orientation, np.float64)
        self.max_speed, self.max_turn_rate, self.lag = max_speed, max_turn_rate, lag
        self.linear, self.angular = np.zeros(3), np.zeros(3)

    def advance(self, command: LinearAngular6DCommand | None, seconds: float) -> RigidBodyState:
        """Go on for some time under a command; None lets the vehicle come to rest."""
        wanted = LinearAngular6DCommand() if command is None else command
        linear, self.linear = self._follow(self.linear, _limited(wanted.linear, self.max_speed), seconds)
        angular, self.angular = self._follow(self.angular, _limited(wanted.angular, self.max_turn_rate), seconds)
        halfway = product(self.orientation, exponential(angular * seconds / 2))
        self.position = self.position + rotation_from_quaternion(halfway) @ linear * seconds
        self.orientation = product(self.orientation, exponential(angular * seconds))
        self.orientation /= np.linalg.norm(self.orientation)
        return RigidBodyState(
            position=self.position.copy(),
            orientation=self.orientation.copy(),
            velocity=rotation_from_quaternion(self.orientation) @ self.linear,
            angular_velocity=self.angular.copy(),
        )

    def _follow(self, now: Array, target: Array, seconds: float) -> tuple[Array, Array]:
        """Mean velocity over the time, and the velocity at its end: both exact for a constant command."""
        if seconds <= 0:
            return now, now
        if self.lag <= 0:
            return target, target
        rest = math.exp(-seconds / self.lag)
        return target + (now - target) * (1 - rest) * self.lag / seconds, target + (now - target) * rest


def _limited(wanted: Array, most: float) -> Array:
    wanted = np.nan_to_num(np.asarray(wanted, np.float64), nan=0.0)
    length = float(np.linalg.norm(wanted))
    return wanted * (most / length) if length > most else wanted
