"""What the launcher does when things go wrong: real processes, killed, stopped and stuck."""

from __future__ import annotations

import contextlib
import os
import random
import signal
import time
from pathlib import Path
from typing import Any

from sonar_component.middleware import connect, connect_task

CHAIN = """
    version: 1
    defaults: {restart_delay: 50 ms, hang_timeout: 1 s}
    tasks:
      pose: {type: SourceTask}
      fls: {type: PoseToSonarTask}
    connections:
      - {from: pose.pose_samples, to: fls.sonar_pose_cmd}
"""
SOURCE = """
    version: 1
    tasks:
      source: {type: SourceTask}
"""


def pid_of(graph: Any, task: str) -> int:
    return int(next(t["pid"] for t in graph.json("list")["tasks"] if t["task"] == task))


def test_a_killed_process_starts_again_and_its_readers_tell_that_from_loss(graph: Any) -> None:
    launcher = graph.start(CHAIN)
    with connect("fls.sonar_samples", policy="circular_buffer", size=1000, timeout=20.0) as port:
        port.read()
        os.kill(pid_of(graph, "fls"), signal.SIGKILL)
        graph.wait_until_said("process fls was killed by SIGKILL; it starts again in 0.05 s")
        graph.wait_until_said("fls: RUNNING", times=2)
        graph.wait_for(lambda: port.read() and port.account.restarts == 1, "reading from the new process")
        assert port.account.lost == 0
    with connect_task("fls") as fls:
        os.kill(pid_of(graph, "pose"), signal.SIGKILL)
        graph.wait_until_said("pose: RUNNING", times=2)
        inputs = graph.wait_for(
            lambda: (d := fls.describe()["inputs"]["sonar_pose_cmd"]["connections"][0])["restarts"] and d, "noticing"
        )
    assert inputs["lost"] == 0
    graph.wait_until_said("fls: warning: pose.pose_samples restarted")
    launcher.send_signal(signal.SIGTERM)
    assert launcher.wait(5) == 0  # everything ended well: what came up again is forgiven


def test_a_task_that_raises_is_brought_up_again_until_it_is_enough(graph: Any) -> None:
    text = """
        version: 1
        tasks:
          bad: {type: RaisingTask, restart_delay: 50 ms, max_restarts: 3}
    """
    launcher = graph.start(text)
    graph.wait_until_said("bad: EXCEPTION: ZeroDivisionError: third cycle", times=4)
    assert graph.said().count("bad: RUNNING") == 4  # the first time and three more
    launcher.send_signal(signal.SIGTERM)
    assert launcher.wait(5) == 1
    assert "Traceback" not in graph.said()
    log = (Path(os.environ["SONAR_LOG_DIR"]) / "graph" / "bad.log").read_text()
    assert "ZeroDivisionError: third cycle" in log


def test_a_stuck_task_is_found_its_stack_is_logged_and_it_starts_again(graph: Any) -> None:
    graph.start("version: 1\ntasks:\n  stuck: {type: StuckTask, hang_timeout: 500 ms, restart_delay: 50 ms}\n")
    graph.wait_until_said("task stuck has not finished its cycle for")
    log = Path(os.environ["SONAR_LOG_DIR"]) / "graph" / "stuck.log"
    graph.wait_for(lambda: "in update_hook" in log.read_text(), "logging the stack")
    assert "stand_ins.py" in log.read_text()
    graph.wait_until_said("stuck: RUNNING", times=2)


def test_a_process_that_gives_no_sign_of_life_is_killed_and_starts_again(graph: Any) -> None:
    graph.start(CHAIN)
    with connect_task("fls", timeout=20.0) as fls:
        graph.wait_for(lambda: fls.describe()["counters"]["cycles"] > 1, "running")
    time.sleep(0.7)  # above the 0.5 s between two signs of life: before, it has the patience for a first cycle
    os.kill(pid_of(graph, "fls"), signal.SIGSTOP)
    graph.wait_until_said("process fls has given no sign of life for 1.")
    graph.wait_until_said("fls: RUNNING", times=2)


def test_a_task_that_does_not_stop_is_left_behind_with_a_word(graph: Any) -> None:
    launcher = graph.start("version: 1\ntasks:\n  stuck: {type: StuckTask, hang_timeout: 60 s}\n")
    graph.wait_until_said("stuck: RUNNING")
    time.sleep(0.3)  # until the third cycle
    launcher.send_signal(signal.SIGINT)
    assert launcher.wait(8) == 1
    assert "stuck: warning: does not return from its hook: stuck.update_hook" in graph.said()
    assert graph.processes() == []


def test_a_task_that_works_on_its_end_is_waited_for(graph: Any) -> None:
    launcher = graph.start("version: 1\ntasks:\n  work: {type: WorkTask, properties: {stopping: 3}}\n")
    graph.wait_until_said("work: RUNNING")
    began = time.monotonic()
    launcher.send_signal(signal.SIGINT)
    assert launcher.wait(20) == 0, graph.said()
    assert time.monotonic() - began >= 3  # above the 2 s of the ladder
    assert "does not" not in graph.said()


def test_seconds_end_well_although_a_task_is_still_coming_up(graph: Any) -> None:
    file = graph.write("version: 1\ntasks:\n  work: {type: WorkTask, properties: {configuring: 3}}\n")
    done = graph.sonar("run", file, "--seconds", 1)
    assert done.returncode == 0, done.stdout


def test_a_task_that_hangs_while_it_comes_up_is_named_with_its_hook(graph: Any) -> None:
    text = "version: 1\ntasks:\n  work: {type: WorkTask, properties: {configuring: 60, sleeping: true}}\n"
    began = time.monotonic()
    done = graph.sonar("run", graph.write(text), "--seconds", 1.5)
    assert time.monotonic() - began < 8  # 1.5 s, 1.5 s of grace, and two interpreters on a busy machine
    assert done.returncode == 1
    assert "work: warning: does not return from its hook: work.configure_hook" in done.stdout
    assert "not well: process work: ended with code 1" in done.stdout


def test_an_operation_that_hangs_is_found_by_its_missing_cycles(graph: Any) -> None:
    graph.start("version: 1\ntasks:\n  source: {type: SourceTask, hang_timeout: 1 s, restart_delay: 50 ms}\n")
    with connect_task("source", timeout=20.0) as source:
        graph.wait_for(lambda: source.describe()["counters"]["cycles"] > 1, "running")
        time.sleep(0.7)  # above the 0.5 s between two signs of life: before, it has the patience for a first cycle
        source.timeout = 0.1
        with contextlib.suppress(TimeoutError):
            source.call("hang", seconds=60)
    graph.wait_until_said("task source has not finished its operation hang for")
    graph.wait_until_said("source: RUNNING", times=2)


def test_what_a_process_printed_outlives_the_next_run(graph: Any) -> None:
    file = graph.write("version: 1\ntasks:\n  work: {type: WorkTask}\n")
    for _ in range(2):
        assert graph.sonar("run", file, "--seconds", 1.5).returncode == 0
    lines = (Path(os.environ["SONAR_LOG_DIR"]) / "graph" / "work.log").read_text().splitlines()
    assert [line for line in lines if line.startswith("configuring")] == ["configuring for 0.0 s"] * 2
    assert sum("process work starts, pid" in line for line in lines) == 2


def test_a_process_that_does_not_stop_is_stopped_by_force(graph: Any) -> None:
    launcher = graph.start("version: 1\ndefaults: {hang_timeout: 60 s}\ntasks:\n  source: {type: SourceTask}\n")
    graph.wait_until_said("source: RUNNING")
    os.kill(pid_of(graph, "source"), signal.SIGSTOP)
    launcher.send_signal(signal.SIGINT)
    assert launcher.wait(8) == 1
    assert "process source does not stop: SIGTERM" in graph.said()
    assert "process source does not stop: SIGKILL" in graph.said()
    assert graph.processes() == []


def test_a_second_signal_kills_at_once(graph: Any) -> None:
    launcher = graph.start("version: 1\ndefaults: {hang_timeout: 60 s}\ntasks:\n  source: {type: SourceTask}\n")
    graph.wait_until_said("source: RUNNING")
    os.kill(pid_of(graph, "source"), signal.SIGSTOP)
    launcher.send_signal(signal.SIGINT)
    time.sleep(0.2)
    began = time.monotonic()
    launcher.send_signal(signal.SIGINT)
    launcher.wait(8)
    assert time.monotonic() - began < 1.5  # far below the 3 s that the ladder alone would take
    assert graph.processes() == []


def test_the_loss_of_a_critical_task_stops_all(graph: Any) -> None:
    text = CHAIN.replace("fls: {type: PoseToSonarTask}", "fls: {type: PoseToSonarTask, critical: true, restart: never}")
    launcher = graph.start(text)
    graph.wait_until_said("fls: RUNNING")
    os.kill(pid_of(graph, "fls"), signal.SIGKILL)
    assert launcher.wait(8) == 1
    assert "a critical task is lost: stopping all" in graph.said()


def test_launches_killed_at_random_moments_leave_nothing_behind(graph: Any) -> None:
    # Every start-up phase is hit: interpreter, imports, building, running. 50 of them, as the issue asks.
    chance = random.Random(6)
    for _ in range(10):
        launchers = [graph.start(SOURCE, "--name", f"g{number}") for number in range(5)]
        for launcher in launchers:
            time.sleep(chance.uniform(0.0, 0.3))
            launcher.kill()
            launcher.wait()
        graph.wait_for(lambda: graph.processes() == [], "dying with the launcher", 1.0)
    assert graph.json("list") == {"tasks": [], "ports": []}
    assert list(Path(os.environ["SONAR_RUN_DIR"]).iterdir()) == []
