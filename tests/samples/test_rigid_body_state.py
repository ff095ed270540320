"""base::samples::RigidBodyState, and Rock's angles against rotations written out by hand."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sonar_component.samples import RigidBodyState
from sonar_component.samples.rigid_body_state import quaternion_from_rpy, rotation_from_quaternion

X, Y, Z = np.eye(3)
ROUNDING = 1e-15  # [-], a few units in the last place of numbers up to 1
angles = st.floats(-math.pi, math.pi)


def elementary(axis: int, angle: float) -> np.ndarray:
    """The textbook rotation about one axis."""
    c, s = math.cos(angle), math.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R = np.eye(3)
    R[i, i] = R[j, j] = c
    R[i, j], R[j, i] = -s, s
    return R


def turned(v: np.ndarray, roll: float = 0, pitch: float = 0, yaw: float = 0) -> np.ndarray:
    return rotation_from_quaternion(quaternion_from_rpy(*np.radians([roll, pitch, yaw]))) @ v


def test_the_fields_are_those_of_rock() -> None:
    rock = (
        "time sourceFrame targetFrame position cov_position orientation cov_orientation velocity cov_velocity "
        "angular_velocity cov_angular_velocity"
    )
    assert [field.name for field in fields(RigidBodyState)] == rock.split()


def test_everything_unset_is_nan() -> None:
    state = RigidBodyState()
    for field in fields(RigidBodyState)[3:]:
        assert np.isnan(getattr(state, field.name)).all(), field.name
    assert (state.time, state.sourceFrame) == (0, "")


@pytest.mark.parametrize(
    ("rpy", "before", "after"),
    [
        ((0, 0, 90), X, Y),  # a positive yaw turns the nose to the left
        ((0, 90, 0), X, -Z),  # a positive pitch turns the nose down
        ((90, 0, 0), Y, Z),  # a positive roll lifts the left side
        ((0, 90, 90), X, -Z),  # the nose points down whatever the yaw
        ((90, 0, 90), Y, Z),
        ((0, 0, 180), X, -X),
    ],
)
def test_angles_turn_as_in_rock(rpy: tuple[float, float, float], before: np.ndarray, after: np.ndarray) -> None:
    np.testing.assert_allclose(turned(before, *rpy), after, atol=ROUNDING)


@given(angles, angles, angles)
def test_the_order_is_yaw_then_pitch_then_roll(roll: float, pitch: float, yaw: float) -> None:
    q = quaternion_from_rpy(roll, pitch, yaw)
    product = elementary(2, yaw) @ elementary(1, pitch) @ elementary(0, roll)
    np.testing.assert_allclose(rotation_from_quaternion(q), product, atol=4 * ROUNDING)
    assert abs(np.linalg.norm(q) - 1) < ROUNDING


@given(st.tuples(*[st.floats(-10, 10)] * 4).filter(lambda q: np.linalg.norm(q) > 1e-3))
def test_any_quaternion_gives_a_rotation(q: tuple[float, ...]) -> None:
    R = rotation_from_quaternion(np.array(q))
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=4 * ROUNDING)
    assert np.linalg.det(R) == pytest.approx(1.0, abs=4 * ROUNDING)
    np.testing.assert_allclose(rotation_from_quaternion(-3 * np.array(q)), R, atol=4 * ROUNDING)


def test_the_scalar_comes_first() -> None:
    half = math.sqrt(0.5)
    np.testing.assert_allclose(quaternion_from_rpy(0, 0, math.pi / 2), [half, 0, 0, half], atol=ROUNDING)


def test_the_transform_takes_a_point_of_the_body_into_the_world() -> None:
    state = RigidBodyState(position=np.array([5e5, 4.65e6, -10.0]), orientation=quaternion_from_rpy(0, 0, math.pi / 2))
    p_WV = state.transform() @ [1.0, 0.0, 0.0, 1.0]
    np.testing.assert_allclose(p_WV, [5e5, 4.65e6 + 1, -10.0, 1.0], atol=1e-9)  # 4.65e6 m in float64


def test_a_pose_is_made_from_a_place_and_angles() -> None:
    made = RigidBodyState.at([1, 2, 3], rpy=[0, 0, math.pi / 2], time=7)
    made.validate()
    assert (made.time, made.position.tolist()) == (7, [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(made.orientation, quaternion_from_rpy(0, 0, math.pi / 2))
    np.testing.assert_array_equal(RigidBodyState.at([0, 0, 0]).orientation, [1, 0, 0, 0])


def state(**changes: Any) -> RigidBodyState:
    return RigidBodyState(**({"position": np.zeros(3), "orientation": np.array([1.0, 0, 0, 0])} | changes))


def test_a_pose_needs_position_and_orientation_only() -> None:
    state().validate()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"position": np.array([0, math.nan, 0])}, r"position must be 3 finite numbers \[m\], got \[0.0, nan, 0.0\]"),
        ({"position": np.array([0, math.inf, 0])}, "position must be 3 finite numbers"),
        ({"position": np.zeros(2)}, "position must be 3 finite numbers"),
        ({"orientation": np.full(4, math.nan)}, r"orientation must be 4 finite numbers \(w, x, y, z\)"),
        ({"orientation": np.zeros(4)}, "orientation must be a unit quaternion, got length 0"),
        ({"orientation": np.array([2.0, 0, 0, 0])}, "orientation must be a unit quaternion, got length 2"),
        ({"orientation": np.array([1.0, 0, 0])}, "orientation must be 4 finite numbers"),
    ],
)
def test_an_unusable_pose_says_which_value_is_wrong(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        state(**changes).validate()


def test_a_quaternion_is_a_unit_within_base_types_own_tolerance() -> None:
    state(orientation=np.array([math.sqrt(1 + 0.9e-6), 0, 0, 0])).validate()
    with pytest.raises(ValueError, match="unit quaternion"):
        state(orientation=np.array([math.sqrt(1 + 1.1e-6), 0, 0, 0])).validate()
