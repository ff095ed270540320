"""ScanningSonarTask, driven without sockets, threads or sleep: the clock is set by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from sonar_component.middleware.clock import SteppedClock
from sonar_component.middleware.lifecycle import State
from sonar_component.middleware.once import run_once
from sonar_component.samples import RigidBodyState, Sonar
from sonar_component.samples.rigid_body_state import quaternion_from_rpy
from sonar_component.scene import Body, Material, Part, World
from sonar_component.scene.shapes import sphere
from sonar_component.sonars.self_test import wall_ahead
from sonar_component.tasks.scanning_sonar import ScanningSonarTask

PERIOD = 0.05  # [s], of the pings in these tests
START = 1_000_000_000  # [us]
SETTINGS: dict[str, Any] = {
    "range": 10.0, "bin_count": 100, "motor_step": "90 deg", "min_ping_period": PERIOD, "head_speed": 900.0,
    "normalization": "energy",
}  # fmt: skip


class Bench:
    """A task with a clock and a scene, fed with poses."""

    def __init__(self, world: World | None = None, **properties: Any) -> None:
        self.clock = SteppedClock(START)
        self.task = ScanningSonarTask("msis", {**SETTINGS, **properties}, clock=self.clock)
        self.scene: list[Any] = [(world or wall_ahead(6.0)).to_description(START)]

    def feed(self, *poses: RigidBodyState, now: float | None = None) -> list[Sonar]:
        """Beams that come out when these poses go in; the clock is set to `now`, or to the last pose."""
        return self.run(*poses, now=now)["sonar_samples"]

    def run(self, *poses: RigidBodyState, now: float | None = None) -> dict[str, list[Any]]:
        self.clock.time = START + round(now * 1e6) if now is not None else poses[-1].time
        scene, self.scene = self.scene, []
        return run_once(self.task, {"scene": scene, "sonar_pose_cmd": list(poses)})


def pose(seconds: float, x: float = 0.0, yaw: float = 0.0) -> RigidBodyState:
    time = START + round(seconds * 1e6)
    return RigidBodyState(
        time=time, position=np.array([x, 0.0, 0.0]), orientation=quaternion_from_rpy(0, 0, yaw), sourceFrame="auv"
    )


@pytest.fixture
def bench(request: pytest.FixtureRequest) -> Any:
    made: list[Bench] = []

    def make(world: World | None = None, **properties: Any) -> Bench:
        made.append(Bench(world, **properties))
        return made[-1]

    yield make
    for one in made:
        if one.task.lifecycle.state in (State.RUNNING, State.RUNTIME_ERROR):
            one.task.stop()
        if one.task.lifecycle.state is State.STOPPED:
            one.task.cleanup()


def test_it_pings_at_its_own_pace_whatever_the_pace_of_the_poses(bench: Any) -> None:
    b = bench()
    beams = b.feed(pose(0.0)) + b.feed(pose(0.12)) + b.feed(pose(0.14)) + b.feed(pose(0.26))
    assert [(s.time - START) / 1e6 for s in beams] == pytest.approx([0.0, 0.05, 0.10, 0.15, 0.20, 0.25])
    assert [round(math.degrees(s.bearings[0])) for s in beams] == [0, 90, 180, -90, 0, 90]
    assert all(s.beam_count == 1 for s in beams)


def test_the_ping_period_is_that_of_range_and_head_when_the_device_is_faster(bench: Any) -> None:
    b = bench(min_ping_period=0.0, range=75.0, speed_of_sound=1500.0, head_speed="900 deg/s", bin_time="1 ms")
    beams = b.feed(pose(0.0), pose(0.9))
    # 2 x 75 m at 1500 m/s, 100 bins of 1 ms, 90 deg at 900 deg/s.
    assert np.diff([s.time for s in beams]) * 1e-6 == pytest.approx([0.3, 0.3, 0.3][: len(beams) - 1])


def test_each_ping_has_the_pose_of_its_own_time(bench: Any) -> None:
    b = bench()
    beams = b.feed(pose(0.0, x=0.0, yaw=0.0), pose(0.2, x=2.0, yaw=0.4))
    assert [s.sensor_position[0] for s in beams] == pytest.approx([0.0, 0.5, 1.0, 1.5, 2.0])
    yaws = [2 * math.atan2(s.sensor_orientation[3], s.sensor_orientation[0]) for s in beams]
    assert yaws == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])


def test_it_sees_the_wall_nearer_from_the_later_pose(bench: Any) -> None:
    b = bench(motor_step="0.1 deg", left_limit=0, right_limit="0.1 deg", continuous=False)
    beams = b.feed(pose(0.0, x=0.0), pose(0.2, x=2.0))
    first = [int(np.flatnonzero(s.bins[0])[0]) for s in beams]
    # 6 m to the wall in bins of 0.1 m; it begins on an edge, so either side of it will do.
    assert np.abs(np.array(first) - [60, 55, 50, 45, 40]).max() <= 1


def test_poses_that_stop_are_extrapolated_so_far_and_no_further(bench: Any) -> None:
    b = bench(max_extrapolation=0.1)
    b.feed(pose(0.0, x=0.0), pose(0.1, x=1.0))
    beams = b.feed(now=0.35)
    assert [s.sensor_position[0] for s in beams] == pytest.approx([1.5, 2.0])
    assert b.task.lifecycle.substate == "EXTRAPOLATING"
    assert b.feed(now=0.4) == []
    assert [(s.time - START) / 1e6 for s in b.feed(pose(0.45, x=4.5))] == pytest.approx([0.25, 0.3, 0.35, 0.4, 0.45])
    assert b.task.lifecycle.substate == ""


def test_a_pose_ten_seconds_old_is_an_error_with_its_reason_and_the_next_good_one_mends_it(bench: Any) -> None:
    b = bench()
    with pytest.raises(
        RuntimeError, match=r"RUNTIME_ERROR: msis.sonar_pose_cmd: the last pose is 10.00 s old, allowed 1 s"
    ):
        b.feed(pose(0.0), now=10.0)
    assert b.task.lifecycle.substate == "STALE_INPUT"
    assert len(b.feed(pose(10.0))) == 1


def test_silence_becomes_an_error_and_the_scan_goes_on_from_the_next_pose(bench: Any) -> None:
    b = bench()
    assert len(b.feed(pose(0.0), pose(0.1))) == 3
    with pytest.raises(RuntimeError, match=r"the last pose is 2\.40 s old"):
        b.feed(now=2.5)
    beams = b.feed(pose(5.0)) + b.feed(pose(5.1))
    assert [(s.time - START) / 1e6 for s in beams] == pytest.approx([5.0, 5.05, 5.1])
    assert round(math.degrees(beams[0].bearings[0])) == 0  # the head has turned on: 100 pings of 90 deg since the start


def test_a_gap_in_the_poses_is_not_bridged(bench: Any) -> None:
    b = bench()
    beams = b.feed(pose(0.0), pose(0.1), pose(3.0))
    assert [(s.time - START) / 1e6 for s in beams] == pytest.approx([3.0])


def test_time_that_runs_backwards_is_an_error_and_the_next_good_pose_mends_it(bench: Any) -> None:
    b = bench()
    b.feed(pose(0.0), pose(0.1))
    with pytest.raises(RuntimeError, match="time runs backwards"):
        b.feed(pose(0.05), now=0.1)
    assert b.task.lifecycle.substate == "INVALID_INPUT"
    assert [(s.time - START) / 1e6 for s in b.feed(pose(0.2))] == pytest.approx([0.15, 0.2])


def test_a_pose_that_is_not_a_number_is_an_error_and_the_next_good_pose_mends_it(bench: Any) -> None:
    b = bench()
    b.feed(pose(0.0))
    with pytest.raises(RuntimeError, match="position must be 3 finite numbers"):
        b.feed(pose(0.05, x=math.nan))
    assert len(b.feed(pose(0.1))) == 2


def test_the_full_scan_is_written_at_the_end_of_each_turn_with_the_time_of_each_beam(bench: Any) -> None:
    b = bench(scan_period=100.0)
    scans = b.run(pose(0.0), pose(0.34))["scan_samples"]
    scans = scans[-1:]
    scans[0].validate()
    assert scans[0].beam_count == 4
    # 0, 90, 180, -90 deg in the order of the pings; leftmost first in the scan.
    assert ((scans[0].timestamps - START) / 1e6).tolist() == pytest.approx([0.05, 0.0, 0.15, 0.10])


def test_a_property_may_change_while_it_turns_and_a_wrong_one_is_refused(bench: Any) -> None:
    b = bench()
    b.feed(pose(0.0))
    b.task.set_property("range", "5 m")
    assert b.feed(pose(0.05))[0].bin_length == pytest.approx(0.05)
    with pytest.raises(ValueError, match="motor_step: must be"):
        b.task.set_property("motor_step", "0 deg")
    with pytest.raises(ValueError, match="cannot change while the task is configured"):
        b.task.set_property("mount", {"position": [1, 0, 0]})
    b.task.set_property("motor_step", "30 deg")
    assert b.task._scan.filled == 0.0


def test_it_sits_where_its_mount_says(bench: Any) -> None:
    b = bench(mount={"position": ["1 m", 0, "0.5 m"], "rpy": [0, 0, "90 deg"]}, frame="msis_top")
    sample = b.feed(pose(0.0, x=2.0, yaw=math.radians(90)))[0]
    assert sample.sensor_position == pytest.approx([2.0, 1.0, 0.5])
    assert abs(sample.sensor_orientation @ quaternion_from_rpy(0, 0, math.pi)) == pytest.approx(1.0)
    assert sample.frame == "msis_top"


def test_the_same_seed_gives_the_same_bits_and_without_noise_they_are_clean(bench: Any) -> None:
    noisy: dict[str, Any] = {"enable_speckle_noise": True, "speckle_properties": "oculus-like"}
    images = [
        np.concatenate([s.bins for s in bench(**chosen).feed(pose(0.0), pose(0.6))])
        for chosen in ({**noisy, "seed": 4}, {**noisy, "seed": 4}, {**noisy, "seed": 5}, {}, {"seed": 5})
    ]
    assert (images[0] == images[1]).all()
    assert (images[0] != images[2]).any()
    assert (images[3] == images[4]).all()


def test_a_vehicle_that_turns_20_degrees_during_a_scan_shows_a_scene_shifted_by_the_turn(bench: Any) -> None:
    # 36 thin posts around the sonar, 10 deg apart. Where the scan shows each of them, drawn by head bearing, differs
    # from where it is by the yaw of the vehicle at that moment: the distortion must equal the turn.
    turn, step, duration = math.radians(20), math.radians(1), 360 * PERIOD
    posts = [math.radians(a) for a in range(0, 360, 10)]
    bodies = []
    for number, bearing in enumerate(posts):
        X_WB = np.eye(4)
        X_WB[:3, 3] = [6 * math.cos(bearing), 6 * math.sin(bearing), 0.0]
        bodies.append(Body(f"post{number}", [Part(sphere(0.05), Material("plain"), np.eye(4))], X_WB))
    b = bench(World(bodies), motor_step="1 deg", beam_width="3 deg", transfer="linear")
    times = np.linspace(0, duration, 91)
    scan: list[Sonar] = []
    for t in times:
        scan += b.feed(pose(float(t), yaw=turn * float(t) / duration))
    scan = scan[:360]
    strength = np.array([s.bins.sum() for s in scan])
    head = np.arange(360) * step  # bearing on the scan, without the wrap
    seen, shifts, yaws = 0, [], []
    for bearing in posts:
        # A post enters and leaves the beam: the middle of the pings that hear it is where the scan shows it.
        expected = bearing / (1 + turn / (2 * math.pi))
        near = np.abs(head - expected) < math.radians(4)
        if bearing == 0 or not strength[near].any():
            continue  # the first post is cut by the seam of the scan
        shown = float((strength * head)[near].sum() / strength[near].sum())
        seen += 1
        shifts.append(bearing - shown)
        yaws.append(turn * shown / (2 * math.pi))
    assert seen >= 34
    # A third of a step: where a ping's beam begins and ends is known to a step, averaged over the pings that hear it.
    assert np.abs(np.array(shifts) - yaws).max() < step / 3
    # And the whole distortion, from seam to seam, is the turn.
    slope = np.polyfit(head[np.rint(np.array(yaws) / turn * 360).astype(int) % 360], shifts, 1)[0] * 2 * math.pi
    assert math.degrees(slope) == pytest.approx(20.0, abs=0.3)
