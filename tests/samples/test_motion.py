"""Motion between poses against rotations and lines that can be written down."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sonar_component.samples import RigidBodyState
from sonar_component.samples.motion import (
    carried_on,
    exponential,
    interpolate,
    inverse,
    logarithm,
    mounted,
    moved_between,
    product,
)
from sonar_component.samples.rigid_body_state import quaternion_from_rpy, rotation_from_quaternion

EXACT = 1e-12  # a few roundings of float64 on numbers of the order of 1


def state(time: int, position: tuple[float, float, float], rpy: tuple[float, float, float]) -> RigidBodyState:
    return RigidBodyState(time=time, position=np.array(position), orientation=quaternion_from_rpy(*rpy))


def same_turn(p: np.ndarray, q: np.ndarray) -> bool:
    return np.allclose(rotation_from_quaternion(p), rotation_from_quaternion(q), atol=1e-9)


def test_a_product_turns_by_the_second_first() -> None:
    p, q = quaternion_from_rpy(0.1, 0.7, -0.4), quaternion_from_rpy(-1.2, 0.3, 2.0)
    both = rotation_from_quaternion(p) @ rotation_from_quaternion(q)
    assert np.allclose(rotation_from_quaternion(product(p, q)), both, atol=EXACT)


def test_logarithm_undoes_exponential_up_to_half_a_turn() -> None:
    rng = np.random.default_rng(2)
    for angle in (0.0, 1e-9, 1e-4, 1.0, 3.1):
        axis = rng.standard_normal(3)
        turn = axis / np.linalg.norm(axis) * angle
        assert np.allclose(logarithm(exponential(turn)), turn, atol=1e-9)


def test_halfway_is_half_the_way_and_half_the_turn() -> None:
    a, b = state(1_000_000, (0, 0, 0), (0, 0, 0)), state(3_000_000, (4, -2, 1), (0, 0, 1.0))
    middle = interpolate(a, b, 2_000_000)
    assert np.allclose(middle.position, [2, -1, 0.5], atol=EXACT)
    assert same_turn(middle.orientation, quaternion_from_rpy(0, 0, 0.5))
    assert np.allclose(middle.velocity, [2, -1, 0.5], atol=EXACT)
    assert np.allclose(middle.angular_velocity, [0, 0, 0.5], atol=EXACT)


def test_a_turn_goes_the_shorter_way_across_180_degrees() -> None:
    a, b = state(0, (0, 0, 0), (0, 0, math.radians(170))), state(2, (0, 0, 0), (0, 0, math.radians(-170)))
    assert same_turn(interpolate(a, b, 1).orientation, quaternion_from_rpy(0, 0, math.pi))


def test_the_sign_of_a_quaternion_does_not_matter() -> None:
    a, b = state(0, (0, 0, 0), (0, 0, 0.2)), state(2, (0, 0, 0), (0, 0, 0.4))
    b.orientation = -b.orientation
    assert same_turn(interpolate(a, b, 1).orientation, quaternion_from_rpy(0, 0, 0.3))


def test_beyond_the_later_pose_it_goes_on_alike() -> None:
    a, b = state(0, (0, 0, 0), (0, 0, 0)), state(1_000_000, (1, 0, 0), (0, 0, 0.1))
    beyond = interpolate(a, b, 1_500_000)
    assert np.allclose(beyond.position, [1.5, 0, 0], atol=EXACT)
    assert same_turn(beyond.orientation, quaternion_from_rpy(0, 0, 0.15))
    assert same_turn(carried_on(interpolate(a, b, 1_000_000), 1_500_000).orientation, beyond.orientation)


def test_poses_of_one_time_or_the_wrong_order_are_refused() -> None:
    a = state(5, (0, 0, 0), (0, 0, 0))
    with pytest.raises(ValueError, match="follow each other in time, got 5 us and then 5 us"):
        interpolate(a, a, 5)


def test_unknown_velocities_carry_nowhere() -> None:
    here = state(0, (1, 2, 3), (0.1, 0.2, 0.3))
    assert np.allclose(carried_on(here, 10**6).position, here.position)
    assert same_turn(carried_on(here, 10**6).orientation, here.orientation)


def test_distance_and_angle_between_poses_keep_their_digits_when_small() -> None:
    for angle in (1e-8, 1e-3, 1.0, 3.0):
        a, b = np.eye(4), np.eye(4)
        b[:3, :3] = rotation_from_quaternion(exponential(np.array([0.0, angle, 0.0])))
        b[:3, 3] = [3.0, 4.0, 0.0]
        distance, turned = moved_between(a, b)
        assert distance == pytest.approx(5.0)
        assert turned == pytest.approx(angle, rel=1e-6)


def test_a_sensor_on_a_long_arm_is_swung_by_the_turn() -> None:
    X_VS = np.eye(4)
    X_VS[:3, 3] = [2.0, 0.0, 0.0]
    q_VS = quaternion_from_rpy(0, 0, math.pi / 2)
    X_VS[:3, :3] = rotation_from_quaternion(q_VS)
    vehicle = state(7, (10, 0, 0), (0, 0, math.pi / 2))
    vehicle.velocity, vehicle.angular_velocity = np.zeros(3), np.array([0.0, 0.0, 0.5])
    sensor = mounted(vehicle, X_VS, q_VS, "sonar")
    assert (sensor.time, sensor.sourceFrame) == (7, "sonar")
    assert np.allclose(sensor.position, [10, 2, 0], atol=EXACT)
    assert np.allclose(sensor.velocity, [-1, 0, 0], atol=EXACT)  # 0.5 rad/s on 2 m
    assert same_turn(sensor.orientation, quaternion_from_rpy(0, 0, math.pi))
    assert np.allclose(product(inverse(q_VS), q_VS), [1, 0, 0, 0], atol=EXACT)
