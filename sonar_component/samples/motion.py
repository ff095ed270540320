"""Poses between and beyond poses: position in a straight line, orientation at a constant rate of turn (slerp)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sonar_component.samples.rigid_body_state import RigidBodyState

Array = NDArray[np.float64]

_TINY = 1e-12  # [rad], a turn that leaves no axis to divide by


def product(p: Array, q: Array) -> Array:
    """Quaternion (w, x, y, z) that turns by q first, then by p."""
    # Written out for single numbers: numpy's cross product alone takes ten times as long as all of this.
    a, b, c, d = (float(value) for value in p)
    w, x, y, z = (float(value) for value in q)
    return np.array(
        [
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ]
    )


def inverse(q: Array) -> Array:
    """The turn back, of a unit quaternion."""
    return np.asarray(q * np.array([1.0, -1.0, -1.0, -1.0]))


def exponential(turn: Array) -> Array:
    """Quaternion of a rotation vector: axis times angle [rad]."""
    angle = float(np.linalg.norm(turn))
    if angle < _TINY:
        return np.array([1.0, 0.0, 0.0, 0.0])
    return np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) / angle * turn])


def logarithm(q: Array) -> Array:
    """Rotation vector [rad] of a unit quaternion, the shorter way round."""
    q = -q if q[0] < 0 else q
    sine = float(np.linalg.norm(q[1:]))
    if sine < _TINY:
        return np.asarray(2.0 * q[1:])
    return np.asarray(2.0 * np.arctan2(sine, q[0]) / sine * q[1:])


def interpolate(earlier: RigidBodyState, later: RigidBodyState, time: int) -> RigidBodyState:
    """The state at a time [us] between two others, or beyond them along the same straight line and turn.

    Velocities are those of that line, so they are known even where the two states do not give theirs.

    Raises
    ------
    ValueError
        If the two are of the same time, or in the wrong order.
    """
    span = (later.time - earlier.time) * 1e-6
    if not span > 0:
        raise ValueError(f"poses must follow each other in time, got {earlier.time} us and then {later.time} us")
    share = (time - earlier.time) * 1e-6 / span
    turn = logarithm(product(inverse(earlier.orientation), later.orientation))
    orientation = product(earlier.orientation, exponential(share * turn))
    return RigidBodyState(
        time=time,
        sourceFrame=later.sourceFrame,
        targetFrame=later.targetFrame,
        position=earlier.position + share * (later.position - earlier.position),
        orientation=orientation / np.linalg.norm(orientation),
        velocity=(later.position - earlier.position) / span,
        angular_velocity=turn / span,
    )


def carried_on(state: RigidBodyState, time: int) -> RigidBodyState:
    """The state at another time [us] if it keeps its velocities; what is NaN of them counts as no motion."""
    seconds = (time - state.time) * 1e-6
    velocity, rate = (np.nan_to_num(v, nan=0.0) for v in (state.velocity, state.angular_velocity))
    orientation = product(np.asarray(state.orientation, np.float64), exponential(seconds * rate))
    return RigidBodyState(
        time=time,
        sourceFrame=state.sourceFrame,
        targetFrame=state.targetFrame,
        position=state.position + seconds * velocity,
        orientation=orientation / np.linalg.norm(orientation),
        velocity=state.velocity,
        angular_velocity=state.angular_velocity,
    )


def moved_between(X_WA: Array, X_WB: Array) -> tuple[float, float]:
    """Distance [m] and angle [rad] between two poses (4, 4)."""
    distance = float(np.linalg.norm(X_WB[:3, 3] - X_WA[:3, 3]))
    # |R_A - R_B| is 2 sqrt(2) sin(angle / 2), which keeps its digits where the angle is small.
    sine = float(np.linalg.norm(X_WB[:3, :3] - X_WA[:3, :3])) / (2 * np.sqrt(2))
    return distance, 2 * float(np.arcsin(min(sine, 1.0)))


def mounted(vehicle: RigidBodyState, X_VS: Array, q_VS: Array, frame: str) -> RigidBodyState:
    """The state of a sensor that is fixed to a vehicle.

    Parameters
    ----------
    X_VS : (4, 4) float64
        Pose of the sensor in the vehicle's frame [m].
    q_VS : (4,) float64
        Its orientation again, as a quaternion (w, x, y, z).
    frame : str
        Name of the sensor's frame.
    """
    X_WV = vehicle.transform()
    arm = X_VS[:3, 3]
    lever = X_WV[:3, :3] @ np.cross(vehicle.angular_velocity, arm)
    return RigidBodyState(
        time=vehicle.time,
        sourceFrame=frame,
        targetFrame=vehicle.targetFrame,
        position=X_WV[:3, :3] @ arm + X_WV[:3, 3],
        orientation=product(np.asarray(vehicle.orientation, np.float64), q_VS),
        velocity=vehicle.velocity + lever,
        angular_velocity=X_VS[:3, :3].T @ vehicle.angular_velocity,
    )
