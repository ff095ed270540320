from __future__ import annotations

import threading
import time
from typing import Any

import numpy as np
import pytest
from pydantic import Field

from sonar_component.middleware import (
    InputPort,
    NoProperties,
    OutputPort,
    Periodic,
    Policy,
    PortDriven,
    Task,
    operation,
    run_once,
)
from sonar_component.middleware.clock import SimulatedClock, SteppedClock
from sonar_component.middleware.lifecycle import State
from sonar_component.middleware.operations import call, operations_of
from sonar_component.middleware.ports import connect_in_process
from sonar_component.middleware.runner import Runner
from sonar_component.samples import RigidBodyState


class Settings(NoProperties):
    low: float = Field(0.1, ge=0, le=1)
    many: int = Field(3, ge=1)
    fixed: str = "a"


class Echo(Task):
    """Passes poses on."""

    Properties = Settings
    dynamic = frozenset({"low", "many"})
    activity = PortDriven()
    pose: InputPort[RigidBodyState] = InputPort(RigidBodyState)
    out: OutputPort[RigidBodyState] = OutputPort(RigidBodyState)

    def update_hook(self) -> None:
        pose = self.pose.read_new()
        if pose is not None:
            self.out.write(pose)

    def property_hook(self, name: str, value: Any) -> None:
        if name == "many" and value == 13:
            raise ValueError("many must not be 13")

    @operation
    def add(self, left: int, right: int = 1) -> int:
        """Add."""
        return left + right


def a_pose(time: int = 1, w: float = 1.0) -> RigidBodyState:
    return RigidBodyState(time=time, position=np.zeros(3), orientation=np.array([w, 0.0, 0.0, 0.0]))


def running(task: Task, max_age: float | None = None) -> OutputPort[RigidBodyState]:
    writer: OutputPort[RigidBodyState] = OutputPort(RigidBodyState).own("pose", "pose_samples")
    connect_in_process(writer, task.inputs["pose"], Policy(), max_age)
    assert task.configure()
    assert task.start()
    return writer


def test_a_task_is_driven_with_no_socket_thread_or_sleep() -> None:
    threads = threading.active_count()
    assert [pose.time for pose in run_once(Echo("echo"), {"pose": a_pose(7)})["out"]] == [7]
    assert threading.active_count() == threads


def test_all_wrong_properties_are_reported_at_once() -> None:
    task = Echo("echo", {"low": 2, "many": 0, "lwo": 1})
    assert not task.configure()
    reason = task.lifecycle.reason
    assert task.lifecycle.state is State.PRE_OPERATIONAL
    for part in (
        "low: must be at most 1, got 2",
        "many: ",
        'lwo: is not a known key (did you mean "low"?)',
    ):
        assert part in reason


def test_a_refused_property_keeps_its_old_value() -> None:
    task = Echo("echo")
    running(task)
    for name, value, message in (
        ("low", 2, "must be at most 1, got 2"),
        ("many", 13, "many must not be 13"),
        ("fixed", "b", "cannot change while the task is configured"),
        ("lwo", 1, 'did you mean "low"'),
    ):
        with pytest.raises(ValueError, match=message):
            task.set_property(name, value)
    assert task.properties == Settings()


@pytest.mark.parametrize("bad", [a_pose(w=2.0), a_pose(w=float("nan"))], ids=["not a unit", "NaN"])
def test_an_unusable_pose_is_an_error_state_until_the_next_good_one(bad: RigidBodyState) -> None:
    task = Echo("echo")
    writer = running(task)
    seen = []
    task.on_change = lambda lifecycle: seen.append(lifecycle.state)
    writer.write(bad)
    task.cycle()
    assert (task.lifecycle.state, task.lifecycle.substate) == (State.RUNTIME_ERROR, "INVALID_INPUT")
    assert task.lifecycle.reason.startswith("echo.pose: orientation must be")
    writer.write(bad)
    task.cycle()
    assert task.lifecycle.state is State.RUNTIME_ERROR
    writer.write(a_pose(9))
    task.cycle()
    assert task.lifecycle.state is State.RUNNING
    assert task.out.last is not None
    assert task.out.last.time == 9  # the good sample itself was used
    assert seen == [State.RUNTIME_ERROR, State.RUNNING]


def test_an_input_that_is_too_old_is_an_error_state_until_a_fresh_one_comes() -> None:
    clock = SteppedClock(10_000_000)
    task = Echo("echo", clock=clock)
    writer = running(task, max_age=0.5)
    writer.write(a_pose(9_400_000))  # 0.6 s old
    task.cycle()
    assert (task.lifecycle.state, task.lifecycle.substate) == (State.RUNTIME_ERROR, "STALE_INPUT")
    assert "echo.pose: no sample from pose.pose_samples for 0.60 s, allowed 0.5 s" in task.lifecycle.reason
    writer.write(a_pose(9_900_000))
    task.cycle()
    assert task.lifecycle.state is State.RUNNING


def test_operations_check_their_arguments() -> None:
    task = Echo("echo")
    assert operations_of(Echo) == {"add": "(left: 'int', right: 'int' = 1) -> 'int'"}
    assert call(task, "add", {"left": 2}) == 3
    with pytest.raises(ValueError, match=r"echo\.add.*left"):
        call(task, "add", {"left": "two"})
    with pytest.raises(ValueError, match="echo has no operation 'sub'; it has: add"):
        call(task, "sub", {})


def test_a_simulated_clock_runs_at_its_rate() -> None:
    clock = SimulatedClock(epoch=5_000_000, start=time.monotonic() - 2.0, rate=10.0)
    assert 25_000_000 <= clock.now() < 26_000_000  # 20 s of simulated time, and 0.1 s of real time for this line


class Ticker(Task):
    """Notes when it ran, and may take long."""

    activity = Periodic(0.02)

    def start_hook(self) -> None:
        self.times: list[float] = []
        self.slow_at = -1

    def update_hook(self) -> None:
        self.times.append(time.monotonic())
        if len(self.times) == self.slow_at:
            time.sleep(0.07)


def run_for(task: Task, seconds: float, *slaves: Task) -> None:
    runner = Runner(task, type(task).activity)
    runner.slaves += slaves
    runner.start()
    for one in (*slaves, task):
        runner.call(one.configure).result(5)
        runner.call(one.start).result(5)
    time.sleep(seconds)
    runner.call(task.stop).result(5)
    assert runner.stop()
    runner.bell.close()


def test_periods_are_kept_by_absolute_deadlines() -> None:
    task = Ticker("ticker")
    run_for(task, 1.0)
    # 50 a second; each end of the window is uncertain by one. A drift of 1 ms a cycle would cost 2 to 3.
    assert abs(len(task.times) + task.counters.overruns - 50) <= 2


def test_missed_deadlines_are_counted_and_left_out() -> None:
    class Slow(Ticker):
        def start_hook(self) -> None:
            super().start_hook()
            self.slow_at = 5

    task = Slow("slow")
    run_for(task, 0.6)
    assert task.counters.overruns >= 2  # 70 ms hold three deadlines, of which the last one is run late
    gaps = np.diff(task.times)
    assert gaps[4] >= 0.07
    phase = (np.array(task.times[6:]) - task.times[0]) / 0.02
    assert np.median(np.abs(phase - phase.round())) < 0.25  # back in the rhythm it had before


def test_a_slave_runs_after_each_cycle_of_its_master_in_the_same_thread() -> None:
    order: list[tuple[str, int]] = []

    class Master(Ticker):
        def update_hook(self) -> None:
            order.append(("master", threading.get_ident()))

    class Follower(Task):
        def update_hook(self) -> None:
            order.append(("slave", threading.get_ident()))

    run_for(Master("master"), 0.2, Follower("follower"))
    names = [name for name, _ in order]
    assert names[:6] == ["master", "slave"] * 3
    assert len({thread for _, thread in order}) == 1


def test_a_task_that_waits_for_its_port_runs_once_for_each_arrival() -> None:
    task = Echo("echo")
    writer: OutputPort[RigidBodyState] = OutputPort(RigidBodyState).own("pose", "pose_samples")
    connect_in_process(writer, task.pose, Policy("buffer", 10, False))
    runner = Runner(task, PortDriven())
    runner.start()
    runner.call(task.configure).result(5)
    runner.call(task.start).result(5)
    for number in range(1, 6):
        writer.write(a_pose(number))
    deadline = time.monotonic() + 5
    while task.out.seq < 5 and time.monotonic() < deadline:
        time.sleep(0.005)
    assert task.out.seq == 5
    idle = task.counters.cycles
    time.sleep(0.1)
    assert task.counters.cycles == idle  # it does not spin
    runner.call(task.stop).result(5)
    assert runner.stop()
    runner.bell.close()
