"""Patterns in closed form: their velocities must be the derivative of their positions, and what is asked must hold."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from sonar_component.samples.motion import inverse, logarithm, product
from sonar_component.samples.rigid_body_state import rotation_from_quaternion
from sonar_component.tasks.trajectory import Circle, FixedPose, Inspection, LawnMower
from sonar_component.tasks.waypoints import Waypoints

START = FixedPose((3.0, -2.0, -10.0), (0.1, 0.2, 0.7))
LEVEL = FixedPose((3.0, -2.0, -10.0), (0.0, 0.0, 0.7))


def wavy(interpolation: Any) -> Waypoints:
    times = np.array([0.0, 1.0, 2.5, 3.0, 5.0])
    positions = np.stack([times, np.sin(times), -times], axis=1)
    yaw = np.array([0.0, 0.5, 1.4, 1.0, -0.5])
    orientations = np.stack([np.cos(yaw / 2), 0 * yaw, 0 * yaw, np.sin(yaw / 2)], axis=1)
    return Waypoints(times, positions, orientations, interpolation)


PATHS: dict[str, Any] = {
    "fixed": START,
    "circle inwards": Circle(START, 5.0, 0.5),
    "circle ahead": Circle(START, 5.0, 0.5, inwards=False),
    "lawn mower": LawnMower(START, 20.0, 4.0, 3, 0.5),
    "inspection": Inspection(START, 4.0, 3.0, 2.5, 0.4),
    "linear waypoints": wavy("linear"),
    "spline waypoints": wavy("spline"),
}


@pytest.mark.parametrize("name", PATHS)
def test_velocities_are_the_derivatives_of_poses(name: str) -> None:
    path, h = PATHS[name], 1e-4  # [s]; differences over it leave h^2 of curvature and 1e-16 / h of rounding
    for t in np.arange(0.217, 200.0 if "waypoints" not in name else 4.9, 0.913):
        here, before, after = path.at(t), path.at(t - h), path.at(t + h)
        assert np.allclose((after.position - before.position) / (2 * h), here.velocity, atol=1e-5), t
        turned = logarithm(product(inverse(before.orientation), after.orientation)) / (2 * h)
        assert np.allclose(turned, here.angular_velocity, atol=1e-5), t


@pytest.mark.parametrize("name", [name for name in PATHS if name != "linear waypoints"])
def test_a_vehicle_does_not_leap(name: str) -> None:
    path, h = PATHS[name], 0.1
    states = [path.at(t) for t in np.arange(0.0, 200.0, h)]
    steps = np.linalg.norm(np.diff([s.position for s in states], axis=0), axis=1)
    assert steps.max() <= 1.8 * h  # the fastest of them, the wavy one, makes 1.75 m/s


def test_a_circle_keeps_its_distance_and_looks_at_its_centre() -> None:
    path = Circle(LEVEL, 5.0, 0.5)
    for t in (0.0, 7.0, 50.0):
        state = path.at(t)
        to_centre = np.array(LEVEL.position) - state.position
        assert np.linalg.norm(to_centre) == pytest.approx(5.0)
        assert np.allclose(rotation_from_quaternion(state.orientation)[:, 0], to_centre / 5.0)
        assert np.linalg.norm(state.velocity) == pytest.approx(0.5)


def test_a_lawn_mower_covers_its_lines_and_comes_back() -> None:
    path = LawnMower(FixedPose((0, 0, 0), (0, 0, 0)), 20.0, 4.0, 3, 1.0)
    turn = math.pi * 2.0
    assert np.allclose(path.at(10.0).position, [10, 0, 0])
    assert np.allclose(path.at(20.0 + turn + 10.0).position, [10, 4, 0])
    assert np.allclose(path.at(2 * (20.0 + turn) + 20.0).position, [20, 8, 0])
    assert np.allclose(path.at(2 * (3 * 20.0 + 2 * turn)).position, [0, 0, 0])


def test_an_inspection_climbs_around_its_centre_and_down_again() -> None:
    path = Inspection(LEVEL, 4.0, 3.0, 2.5, 0.4)
    length = math.hypot(2 * math.pi * 2.5 * 4.0, 3.0)
    heights = [path.at(share * length / 0.4).position[2] + 10.0 for share in (0.0, 0.5, 1.0, 1.5, 2.0)]
    assert heights == pytest.approx([0.0, 1.5, 3.0, 1.5, 0.0])
    for t in (1.0, 60.0, 250.0):
        state = path.at(t)
        assert np.linalg.norm(state.velocity) == pytest.approx(0.4)
        assert np.linalg.norm(state.position[:2] - [3.0, -2.0]) == pytest.approx(4.0)


def test_waypoints_are_met_exactly() -> None:
    for interpolation in ("linear", "spline"):
        path = wavy(interpolation)
        for t, position, orientation in zip(path.times, path.positions, path.orientations, strict=True):
            state = path.at(float(t))
            assert np.allclose(state.position, position, atol=1e-12)
            assert abs(state.orientation @ orientation) == pytest.approx(1.0)


def test_a_spline_keeps_its_velocity_through_a_waypoint() -> None:
    path = wavy("spline")
    for t in path.times[1:-1]:
        before, after = path.at(float(t) - 1e-6), path.at(float(t) + 1e-6)
        # Velocities are taken over a millisecond, in which the greatest acceleration here changes them by 3e-3.
        assert np.allclose(before.velocity, after.velocity, atol=5e-3)
        assert np.allclose(before.angular_velocity, after.angular_velocity, atol=5e-3)


def test_a_spline_reproduces_constant_motion() -> None:
    times = np.array([0.0, 0.5, 2.0, 2.2])
    orientations = np.stack([np.cos(times / 4), 0 * times, np.sin(times / 4), 0 * times], axis=1)
    path = Waypoints(times, np.outer(times, [1.0, 2.0, -1.0]), orientations)
    for t in np.linspace(0.01, 2.19, 23):
        state = path.at(float(t))
        assert np.allclose(state.position, t * np.array([1.0, 2.0, -1.0]), atol=1e-12)
        assert np.allclose(state.angular_velocity, [0, 0.5, 0], atol=1e-9)


def test_after_the_last_waypoint_it_holds_or_begins_again() -> None:
    held = wavy("linear").at(7.0)
    assert np.allclose(held.position, wavy("linear").positions[-1])
    assert not held.velocity.any()
    repeated = Waypoints(
        *(getattr(wavy("linear"), n) for n in ("times", "positions", "orientations")), "linear", "repeat"
    )
    assert np.allclose(repeated.at(7.0).position, repeated.at(2.0).position)


def test_one_waypoint_is_a_place() -> None:
    path = Waypoints(np.zeros(1), np.array([[1.0, 2.0, 3.0]]), np.array([[1.0, 0, 0, 0]]))
    assert np.allclose(path.at(3.0).position, [1, 2, 3])
    assert not path.at(3.0).velocity.any()
