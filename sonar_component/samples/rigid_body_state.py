"""A body's pose and velocity, after Rock's base::samples::RigidBodyState.

X forward, Y left, Z up; the world is North-West-Up. The state is that of ``sourceFrame`` expressed in ``targetFrame``.
The orientation is a unit quaternion (w, x, y, z): scalar first, as on the command line.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_UNIT_TOLERANCE = 1e-6  # [-], on |q|^2 - 1: base-types' own rule for a valid orientation


def _unknown(*shape: int) -> Array:
    return np.full(shape, np.nan)


@dataclass
class RigidBodyState:
    """Pose, velocity and their covariances; everything unset is NaN.

    Attributes
    ----------
    time : int
        When the state was true in the world [us]; 0 means not set.
    sourceFrame, targetFrame : str
        The body, and the frame in which it is expressed.
    position : (3,) float64
        Origin of the source in the target frame [m].
    orientation : (4,) float64
        Unit quaternion (w, x, y, z) that turns source coordinates into target coordinates.
    velocity : (3,) float64
        In the target frame [m/s].
    angular_velocity : (3,) float64
        Axis times rate, in the source frame [rad/s].
    cov_position, cov_orientation, cov_velocity, cov_angular_velocity : (3, 3) float64
        Covariances in the squares of those units.
    """

    time: int = 0
    sourceFrame: str = ""
    targetFrame: str = ""
    position: Array = field(default_factory=lambda: _unknown(3))
    cov_position: Array = field(default_factory=lambda: _unknown(3, 3))
    orientation: Array = field(default_factory=lambda: _unknown(4))
    cov_orientation: Array = field(default_factory=lambda: _unknown(3, 3))
    velocity: Array = field(default_factory=lambda: _unknown(3))
    cov_velocity: Array = field(default_factory=lambda: _unknown(3, 3))
    angular_velocity: Array = field(default_factory=lambda: _unknown(3))
    cov_angular_velocity: Array = field(default_factory=lambda: _unknown(3, 3))

    @classmethod
    def at(cls, position: Sequence[float], rpy: Sequence[float] = (0.0, 0.0, 0.0), time: int = 0) -> RigidBodyState:
        """A pose in the world.

        Parameters
        ----------
        position : 3 numbers
            [m].
        rpy : 3 numbers
            Roll, pitch and yaw [rad] as in ``quaternion_from_rpy``.
        time : int
            [us].
        """
        return cls(time, position=np.array(position, np.float64), orientation=quaternion_from_rpy(*rpy))

    def validate(self) -> None:
        """Raise ValueError unless position and orientation are usable; say which value is not."""
        # On plain numbers: NumPy takes ten times as long over so few.
        position, orientation = np.asarray(self.position), np.asarray(self.orientation)
        if position.shape != (3,) or not all(map(math.isfinite, position.tolist())):
            raise ValueError(f"position must be 3 finite numbers [m], got {position.tolist()}")
        if orientation.shape != (4,) or not all(map(math.isfinite, orientation.tolist())):
            raise ValueError(f"orientation must be 4 finite numbers (w, x, y, z), got {orientation.tolist()}")
        squared = sum(component * component for component in orientation.tolist())
        if abs(squared - 1.0) > _UNIT_TOLERANCE:
            raise ValueError(f"orientation must be a unit quaternion, got length {squared**0.5:.6g}")

    def transform(self) -> Array:
        """Pose of the source in the target frame.

        Returns
        -------
        (4, 4) float64
            X_TS: source coordinates to target coordinates [m].
        """
        X_TS = np.eye(4)
        X_TS[:3, :3] = rotation_from_quaternion(self.orientation)
        X_TS[:3, 3] = self.position
        return X_TS


def rotation_from_quaternion(q: Array) -> Array:
    """Rotation matrix of a quaternion (w, x, y, z); its length is divided out.

    Returns
    -------
    (3, 3) float64
    """
    w, x, y, z = np.asarray(q, np.float64).tolist()
    length = math.sqrt(w * w + x * x + y * y + z * z)
    w, x, y, z = w / length, x / length, y / length, z / length
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_from_rpy(roll: float, pitch: float, yaw: float) -> Array:
    """Quaternion (w, x, y, z) of Rock's ZYX angles [rad]: yaw about Z, then pitch about Y, then roll about X.

    With X forward, Y left and Z up a positive pitch turns the nose down.

    Returns
    -------
    (4,) float64
    """
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(a / 2), np.sin(a / 2)) for a in (roll, pitch, yaw))
    return np.array(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
    )
