"""Poses from outside: what is believed, what is refused, and what lies between."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sonar_component.samples import RigidBodyState
from sonar_component.samples.rigid_body_state import quaternion_from_rpy
from sonar_component.tasks.pose_track import PoseTrack


def pose(seconds: float, x: float = 0.0, yaw: float = 0.0) -> RigidBodyState:
    orientation = quaternion_from_rpy(0, 0, yaw)
    return RigidBodyState(time=round(seconds * 1e6), position=np.array([x, 0.0, 0.0]), orientation=orientation)


def test_between_two_poses_it_interpolates_and_beyond_the_last_it_goes_on() -> None:
    track = PoseTrack(1.0)
    for t in (1.0, 1.2, 1.4):
        track.add(pose(t, x=t**2))
    assert track.at(1_100_000).position[0] == pytest.approx((1.0 + 1.44) / 2)
    assert track.at(1_300_000).position[0] == pytest.approx((1.44 + 1.96) / 2)
    assert track.at(1_400_000).position[0] == pytest.approx(1.96)
    assert track.at(1_500_000).position[0] == pytest.approx(1.96 + (1.96 - 1.44) / 2)


def test_it_does_not_know_what_was_before_its_first_pose() -> None:
    track = PoseTrack(1.0)
    with pytest.raises(ValueError, match="no pose came yet"):
        track.at(0)
    track.add(pose(1.0))
    track.add(pose(1.1))
    with pytest.raises(ValueError, match="the oldest is of 1000000 us"):
        track.at(999_999)


def test_the_same_pose_again_is_passed_over() -> None:
    track = PoseTrack(1.0)
    assert track.add(pose(1.0))
    assert not track.add(pose(1.0))


def test_time_that_runs_backwards_is_refused_and_the_next_good_pose_goes_on() -> None:
    track = PoseTrack(10.0)
    track.add(pose(5.0))
    with pytest.raises(ValueError, match="time runs backwards: a pose of 4000000 us after one of 5000000 us"):
        track.add(pose(4.0))
    track.add(pose(5.1))
    assert track.newest is not None
    assert track.newest.time == 5_100_000


def test_a_log_that_begins_anew_costs_one_sample() -> None:
    track = PoseTrack(10.0)
    track.add(pose(500.0))
    with pytest.raises(ValueError, match="backwards"):
        track.add(pose(1.0))
    track.add(pose(1.1, x=0.1))
    assert track.at(1_050_000).position[0] == pytest.approx(0.05)


def test_a_gap_is_not_bridged() -> None:
    track = PoseTrack(0.5)
    track.add(pose(1.0))
    track.add(pose(1.1))
    track.add(pose(3.0))
    assert track.begins() == 3_000_000


def test_a_vehicle_that_jumps_or_spins_is_not_believed_at_once() -> None:
    track = PoseTrack(1.0, most_speed=5.0, most_turn=math.radians(90))
    track.add(pose(1.0))
    with pytest.raises(ValueError, match=r"jumps 20 m in 0.1 s, 200 m/s, allowed 5 m/s"):
        track.add(pose(1.1, x=20.0))
    track.add(pose(1.2, x=0.1))
    with pytest.raises(ValueError, match=r"turns 1 rad in 0\.1 s, 10 rad/s"):
        track.add(pose(1.3, yaw=1.0))
    # A vehicle that was put elsewhere stays there: two poses that agree are believed.
    with pytest.raises(ValueError, match="jumps"):
        track.add(pose(1.4, x=100.0))
    track.add(pose(1.5, x=100.1))
    assert track.begins() == 1_400_000
