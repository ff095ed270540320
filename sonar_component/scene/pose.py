"""Rigid poses as 4 x 4 matrices, X_AB: the pose of B in A."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sonar_component.samples.rigid_body_state import rotation_from_quaternion

Pose = NDArray[np.float64]


def from_rpy(position: Sequence[float], rpy: Sequence[float]) -> Pose:
    """Pose from a position [m] and roll, pitch, yaw [rad] about the fixed axes X, Y, Z in this order, as in SDF."""
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(a), np.sin(a)) for a in rpy)
    X = np.eye(4)
    X[:3, :3] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    X[:3, 3] = position
    return X


def from_quaternion(position: Sequence[float], wxyz: Sequence[float]) -> Pose:
    """Pose from a position [m] and a quaternion (w, x, y, z), which is made unit first."""
    X = np.eye(4)
    X[:3, :3] = rotation_from_quaternion(np.asarray(wxyz, np.float64))
    X[:3, 3] = position
    return X


def inverse(X_AB: Pose) -> Pose:
    """X_BA of a rigid X_AB."""
    X_BA = np.eye(4)
    X_BA[:3, :3] = X_AB[:3, :3].T
    X_BA[:3, 3] = -X_AB[:3, :3].T @ X_AB[:3, 3]
    return X_BA
