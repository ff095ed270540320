"""VehiclePoseTask, driven without sockets, threads or sleep: what moves the vehicle, and what is not believed."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sonar_component.middleware.clock import SteppedClock
from sonar_component.middleware.once import run_once
from sonar_component.middleware.policy import Policy
from sonar_component.middleware.ports import OutputPort, connect_in_process
from sonar_component.samples import LinearAngular6DCommand, RigidBodyState
from sonar_component.samples.rigid_body_state import quaternion_from_rpy
from sonar_component.tasks.vehicle_pose import VehiclePoseTask

START = 1_000_000_000  # [us]


class Bench:
    def __init__(self, beside: Path | None = None, **properties: Any) -> None:
        self.clock = SteppedClock(START)
        self.task = VehiclePoseTask("pose", properties, clock=self.clock, beside=beside)

    def at(self, seconds: float, **inputs: Any) -> RigidBodyState:
        return self.all_at(seconds, **inputs)[-1]

    def all_at(self, seconds: float, **inputs: Any) -> list[RigidBodyState]:
        self.clock.time = START + round(seconds * 1e6)
        return run_once(self.task, inputs)["pose_samples"]


def command(linear: Any = (0, 0, 0), angular: Any = (0, 0, 0)) -> LinearAngular6DCommand:
    return LinearAngular6DCommand(time=1, linear=np.array(linear, float), angular=np.array(angular, float))


def pose(seconds: float, x: float = 0.0, yaw: float = 0.0) -> RigidBodyState:
    time = START + round(seconds * 1e6)
    return RigidBodyState(time=time, position=np.array([x, 0.0, 0.0]), orientation=quaternion_from_rpy(0, 0, yaw))


def yaw_of(state: RigidBodyState) -> float:
    return 2 * math.atan2(state.orientation[3], state.orientation[0])


def test_a_vehicle_without_orders_stays_and_says_when() -> None:
    b = Bench(position=["1 m", 2, -3], rpy=[0, 0, "90 deg"], frame="auv")
    b.at(0.0)
    state = b.at(5.0)
    assert (state.time, state.sourceFrame, state.targetFrame) == (START + 5_000_000, "auv", "world")
    assert state.position.tolist() == [1, 2, -3]
    assert yaw_of(state) == pytest.approx(math.pi / 2)
    assert not state.velocity.any()


def test_a_file_is_followed_from_where_the_vehicle_begins(tmp_path: Path) -> None:
    (tmp_path / "turn.csv").write_text("time,x,y,z,roll,pitch,yaw [deg]\n0,0,0,0,0,0,0\n10,5,0,0,0,0,20\n")
    trajectory = {"kind": "file", "file": "turn.csv", "interpolation": "linear"}
    b = Bench(tmp_path / "d.yaml", position=[10, 0, 0], rpy=[0, 0, "90 deg"], trajectory=trajectory)
    b.at(0.0)
    state = b.at(5.0)
    assert np.allclose(state.position, [10, 2.5, 0])  # its X is the world's Y
    assert math.degrees(yaw_of(state)) == pytest.approx(100)
    assert np.allclose(state.velocity, [0, 0.5, 0])
    assert math.degrees(yaw_of(b.at(60.0))) == pytest.approx(110)


def test_a_wrong_file_is_refused_with_its_line_before_anything_starts(tmp_path: Path) -> None:
    (tmp_path / "bad.csv").write_text("time,x\n1,0\n0,0\n")
    given = {"trajectory": {"kind": "file", "file": "bad.csv"}}
    b = Bench(tmp_path / "d.yaml", **given)
    with pytest.raises(RuntimeError, match=r"bad.csv:3: time: time must grow"):
        b.at(0.0)
    properties = VehiclePoseTask.Properties.model_validate(given)
    [(key, message)] = VehiclePoseTask.check(properties, tmp_path / "d.yaml")
    assert key == "trajectory"
    assert "bad.csv:3" in message


def test_a_commanded_vehicle_approaches_its_command_by_its_lag() -> None:
    b = Bench(commanded={"lag": "0.5 s", "timeout": "100 s"})
    b.at(0.0, velocity_cmd=command([1, 0, 0]))
    for t in np.arange(0.1, 2.05, 0.1):
        state = b.at(float(t), velocity_cmd=command([1, 0, 0]))
    # v(t) = 1 - exp(-t / lag), x(t) = t - lag (1 - exp(-t / lag)): exact, whatever the rate of the task.
    assert state.velocity[0] == pytest.approx(1 - math.exp(-4))
    assert state.position[0] == pytest.approx(2 - 0.5 * (1 - math.exp(-4)))


def test_commands_are_in_the_vehicle_s_frame_and_a_steady_turn_makes_a_circle() -> None:
    b = Bench(commanded={"lag": 0, "timeout": 100})
    b.at(0.0, velocity_cmd=command([0.5, 0, 0], [0, 0, 0.25]))
    steps = 400
    for n in range(1, steps + 1):
        state = b.at(n * 2 * math.pi / 0.25 / steps, velocity_cmd=command([0.5, 0, 0], [0, 0, 0.25]))
        if n == steps // 4:
            # A quarter of a circle of 2 m; chords of 400 steps miss it by 2e-5 of its radius.
            assert np.allclose(state.position, [2, 2, 0], atol=1e-3)
            assert np.allclose(state.velocity, [0, 0.5, 0], atol=1e-3)
    assert np.allclose(state.position, 0, atol=1e-3)


def test_commands_beyond_the_limits_are_scaled_down_and_keep_their_direction() -> None:
    b = Bench(commanded={"lag": 0, "max_speed": "1 m/s", "max_turn_rate": "10 deg/s"})
    b.at(0.0, velocity_cmd=command([3, 4, 0], [0, 0, 1]))
    state = b.at(0.5, velocity_cmd=command([3, 4, 0], [0, 0, 0]))
    assert np.allclose(state.velocity[:2], [0.6, 0.8], atol=0.1)
    assert np.linalg.norm(state.velocity) == pytest.approx(1.0)


def test_a_command_that_stops_coming_lets_the_vehicle_come_to_rest_and_says_so() -> None:
    b = Bench(commanded={"lag": "0.1 s", "timeout": "1 s"})
    b.at(0.0, velocity_cmd=command([1, 0, 0]))
    assert b.at(0.9).velocity[0] > 0.9
    b.at(1.5)
    assert b.at(2.5).velocity[0] < 0.01
    assert b.task.lifecycle.substate == "NO_COMMAND"
    assert b.at(2.6, velocity_cmd=command([1, 0, 0])).velocity[0] > 0.3
    assert b.task.lifecycle.substate == ""


def test_an_infinite_command_is_an_error_and_an_axis_that_is_not_commanded_is_none() -> None:
    b = Bench()
    b.at(0.0, velocity_cmd=command())
    with pytest.raises(RuntimeError, match="linear must be 3 numbers"):
        b.at(0.1, velocity_cmd=command([math.inf, 0, 0]))
    b.at(0.2, velocity_cmd=command([math.nan, 1, math.nan]))
    assert b.at(0.3).velocity[1] > 0


def test_a_pose_from_outside_is_passed_on_with_the_velocity_that_led_there() -> None:
    b = Bench(frame="auv")
    assert b.all_at(0.0, pose_cmd=[]) == [] or b.task.lifecycle.substate == ""
    b = Bench(frame="auv")
    b.at(0.0, pose_cmd=pose(0.0))
    state = b.at(0.1, pose_cmd=pose(0.1, x=0.05, yaw=0.02))
    assert (state.time, state.sourceFrame) == (START + 100_000, "auv")
    assert np.allclose(state.velocity, [0.5, 0, 0])
    assert np.allclose(state.angular_velocity, [0, 0, 0.2])
    assert b.all_at(0.15) == []  # nothing new came: nothing is made up


@pytest.mark.parametrize(
    ("bad", "substate", "words"),
    [
        (pose(0.05), "INVALID_INPUT", "time runs backwards"),
        (pose(0.2, x=50.0), "INVALID_INPUT", r"jumps 50 m in 0.1 s, 500 m/s, allowed 10 m/s"),
        (pose(0.2, yaw=2.0), "INVALID_INPUT", "turns 2 rad"),
        (pose(0.2, x=math.nan), "INVALID_INPUT", "position must be 3 finite numbers"),
    ],
)
def test_a_pose_that_cannot_be_is_an_error_with_its_reason_and_the_next_good_one_mends_it(
    bad: RigidBodyState, substate: str, words: str
) -> None:
    b = Bench()
    b.at(0.1, pose_cmd=pose(0.1))
    with pytest.raises(RuntimeError, match=words):
        b.at(0.2, pose_cmd=bad)
    assert b.task.lifecycle.substate == substate
    assert b.task.lifecycle.reason.count("pose.pose_cmd") <= 1
    assert b.at(0.3, pose_cmd=pose(0.3, x=0.1)).position[0] == pytest.approx(0.1)
    assert b.task.lifecycle.substate == ""


def test_a_pose_ten_seconds_old_is_stale_and_so_is_silence() -> None:
    b = Bench()
    with pytest.raises(RuntimeError, match=r"pose.pose_cmd: the last pose is 10.00 s old, allowed 1 s"):
        b.at(10.0, pose_cmd=pose(0.0))
    assert b.task.lifecycle.substate == "STALE_INPUT"
    assert b.at(10.1, pose_cmd=pose(10.1)).time == START + 10_100_000
    with pytest.raises(RuntimeError, match="STALE_INPUT|old"):  # noqa: RUF043
        b.at(12.0)
    assert b.at(12.1, pose_cmd=pose(12.1)).time == START + 12_100_000


def test_two_masters_are_refused() -> None:
    b = Bench()
    for name, kind in (("pose_cmd", RigidBodyState), ("velocity_cmd", LinearAngular6DCommand)):
        writer: OutputPort[Any] = OutputPort(kind).own("elsewhere", name)
        connect_in_process(writer, b.task.inputs[name], Policy())
    with pytest.raises(RuntimeError, match="only one can move the vehicle"):
        b.at(0.0)


def test_a_new_place_holds_from_the_next_cycle_on() -> None:
    b = Bench()
    b.at(0.0)
    b.task.set_property("position", [1, 2, 3])
    assert b.at(0.1).position.tolist() == [1, 2, 3]
    with pytest.raises(ValueError, match="no such file"):
        b.task.set_property("trajectory", {"kind": "file", "file": "none.csv"})
    assert b.at(0.2).position.tolist() == [1, 2, 3]
