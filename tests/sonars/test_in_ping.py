"""Motion within a ping: which pose each bin is heard from."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sonar_component.samples import RigidBodyState
from sonar_component.sonars.in_ping import MOST_POSES, moving_echoes, poses_needed

C = 1500.0  # [m/s]


def pose(velocity: float = 0.0, rate: float = 0.0) -> RigidBodyState:
    return RigidBodyState(
        time=1_000_000, position=np.zeros(3), orientation=np.array([1.0, 0, 0, 0]),
        velocity=np.array([velocity, 0, 0]), angular_velocity=np.array([0, 0, rate]),
    )  # fmt: skip


def heard_from(state: RigidBodyState, last_range: float, bin_length: float, beam: float = 0.05) -> np.ndarray:
    """Time after sending of the pose that each bin is rendered from [s]."""

    def echoes(at: RigidBodyState) -> np.ndarray:
        return np.full((1, round(last_range / bin_length)), (at.time - state.time) * 1e-6, np.float32)

    return moving_echoes(echoes, state, last_range, bin_length, C, beam)[0]


@pytest.mark.parametrize(("velocity", "rate"), [(1.0, 0.0), (0.3, 0.0), (0.0, 0.5), (1.5, -0.2)])
def test_each_bin_is_heard_from_where_the_sonar_is_when_sound_turns_there(velocity: float, rate: float) -> None:
    last_range, bin_length, beam = 75.0, 0.05, math.radians(1)
    state = pose(velocity, rate)
    times = heard_from(state, last_range, bin_length, beam)
    true = (np.arange(times.size) + 0.5) * bin_length / C
    # Half a bin of way, an eighth of a beam of turn, and the microsecond to which times are rounded.
    assert (np.abs(times - true) * velocity).max() <= bin_length / 2 + 2e-6
    assert (np.abs(times - true) * abs(rate)).max() <= beam / 8 + 2e-6
    assert (np.diff(times) >= 0).all()


def test_a_sonar_at_rest_needs_one_pose_and_a_wild_one_not_more_than_the_most() -> None:
    assert poses_needed(pose(), 0.05, 0.05, 0.02) == 1
    assert poses_needed(pose(100.0, 100.0), 0.05, 0.05, 0.02) == MOST_POSES
    unknown = RigidBodyState(time=1, position=np.zeros(3), orientation=np.array([1.0, 0, 0, 0]))
    assert poses_needed(unknown, 0.05, 0.05, 0.02) == 1
