"""Rigid poses against rotations done by hand."""

import numpy as np
import pytest

from sonar_component.scene import pose


@pytest.mark.parametrize(
    ("rpy", "forward", "up"),
    [
        ((0, 0, np.pi / 2), (0, 1, 0), (0, 0, 1)),  # yaw turns X to the left
        ((0, np.pi / 2, 0), (0, 0, -1), (1, 0, 0)),  # pitch turns X down
        ((np.pi / 2, 0, 0), (1, 0, 0), (0, -1, 0)),  # roll turns Y up and Z to the right
        ((np.pi / 2, 0, np.pi / 2), (0, 1, 0), (1, 0, 0)),  # first roll, then yaw, about the fixed axes
    ],
)
def test_roll_pitch_and_yaw_turn_about_the_fixed_axes(rpy: tuple[float, ...], forward: object, up: object) -> None:
    X = pose.from_rpy((1, 2, 3), rpy)
    assert X[:3, 0] == pytest.approx(forward)
    assert X[:3, 2] == pytest.approx(up)
    assert X[:3, 3].tolist() == [1, 2, 3]


def test_a_quaternion_of_any_length_is_made_unit() -> None:
    half = 0.3
    X = pose.from_quaternion((0, 0, 0), (2 * np.cos(half), 0, 0, 2 * np.sin(half)))
    assert pose.from_rpy((0, 0, 0), (0, 0, 2 * half)) == pytest.approx(X)


def test_the_inverse_undoes_a_pose() -> None:
    X = pose.from_rpy((1, -2, 3), (0.4, -1.1, 2.5))
    assert pose.inverse(X) @ X == pytest.approx(np.eye(4))
