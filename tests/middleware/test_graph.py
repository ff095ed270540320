"""Deployments as real processes with real sockets, seen from outside."""

from __future__ import annotations

import itertools
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from sonar_component.middleware import connect, connect_task
from sonar_component.samples import Sonar
from sonar_component.settings import SettingsError

CHAIN = """
    version: 1
    tasks:
      pose: {type: SourceTask}
      fls: {type: PoseToSonarTask, properties: {beams: 256, bins: 500}}
    connections:
      - {from: pose.pose_samples, to: fls.sonar_pose_cmd}
"""
SOURCE = """
    version: 1
    tasks:
      source: {type: SourceTask}
"""


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().split(") ")[1][0] != "Z"
    except OSError:
        return False


def test_a_process_that_shares_only_the_port_reads_frames(graph: Any) -> None:
    graph.start(CHAIN)
    with connect("fls.sonar_samples", Sonar, timeout=20.0) as port:
        frames = list(itertools.islice(port, 5))
    assert all(sonar.bins.shape == (256, 500) for sonar in frames)
    assert [b.time > a.time for a, b in itertools.pairwise(frames)] == [True] * 4


def test_the_javascript_reader_reads_a_live_sonar(graph: Any) -> None:
    tools = Path(__file__).parents[2] / "tools"
    modules = tools / "node_modules"
    if shutil.which("node") is None:
        pytest.skip("node is not installed: apt install nodejs npm")
    if not modules.is_dir():
        patience = ["--fetch-retries=0", "--fetch-timeout=15000"]  # [ms]; npm's own is minutes, where nothing answers
        command = ["npm", "install", "--prefix", str(tools), "--no-audit", "--no-fund", *patience]
        if subprocess.run(command, capture_output=True, check=False).returncode:
            pytest.skip("the reader's packages cannot be fetched: npm install --prefix tools")
    graph.start(CHAIN.replace("beams: 256", "beams: 3").replace("bins: 500", "bins: 100"))
    with connect("fls.sonar_samples", timeout=20.0):
        endpoint = json.loads((Path(os.environ["SONAR_RUN_DIR"]) / "graph" / "fls.json").read_text())["ports"]
        address = endpoint["sonar_samples"]["endpoint"]
        command = ["node", str(tools / "read_sonar.mjs"), address, "fls.sonar_samples", "2"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert [line["shape"] for line in lines] == [[3, 100]] * 2, done.stderr
    assert lines[0]["source"] == "fls.sonar_samples"
    assert lines[0]["left"] == 0.5


def test_nothing_is_computed_for_nobody_and_at_once_for_somebody(graph: Any) -> None:
    graph.start(SOURCE)
    with connect_task("source", timeout=20.0) as source:
        graph.wait_for(lambda: source.state()["state"] == "RUNNING", "running")
        time.sleep(0.2)
        assert source.call("rendered_count") == 0
        asked = time.monotonic()
        with connect("source.sonar_samples", timeout=5.0) as port:
            opened = time.monotonic()
            port.read()
            # One period of 20 ms and 50 ms for connecting, of the issue; opening a client itself is not in it.
            assert time.monotonic() - opened < 0.02 + 0.05 + (opened - asked)
        graph.wait_for(lambda: source.describe()["outputs"]["sonar_samples"]["listeners"] == 0, "leaving", 1.0)
        before = source.call("rendered_count")
        time.sleep(0.2)
        assert source.call("rendered_count") == before


def test_nothing_is_computed_a_second_after_the_reader_was_killed(graph: Any) -> None:
    graph.start(SOURCE)
    with connect_task("source", timeout=20.0) as source:
        reader = subprocess.Popen(
            [sys.executable, "-m", "sonar_component", "echo", "source.sonar_samples"],
            env=graph.environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        graph.wait_for(lambda: source.call("rendered_count") > 3, "rendering for the reader")
        reader.kill()
        reader.wait()
        time.sleep(1.0)
        before = source.call("rendered_count")
        time.sleep(0.2)
        assert source.call("rendered_count") == before


def test_a_late_joiner_has_the_last_value_at_once(graph: Any) -> None:
    graph.start(SOURCE)
    with connect_task("source", timeout=20.0) as source:
        graph.wait_for(lambda: source.state()["state"] == "RUNNING", "running")
    with connect("source.state", timeout=5.0) as port:  # it was written before we came, and will not be again
        assert port.read(1.0).state == "RUNNING"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_stops_everything_in_order(graph: Any, number: signal.Signals) -> None:
    launcher = graph.start(CHAIN)
    graph.wait_until_said("fls: RUNNING")
    launcher.send_signal(number)
    assert launcher.wait(5) == 0
    assert graph.processes() == []
    assert list(Path(os.environ["SONAR_RUN_DIR"]).iterdir()) == []


def test_no_process_lives_a_second_after_the_launcher_is_killed(graph: Any) -> None:
    launcher = graph.start(CHAIN)
    graph.wait_until_said("fls: RUNNING")
    children = graph.processes()
    assert len(children) == 2
    launcher.kill()
    launcher.wait()
    graph.wait_for(lambda: not any(is_alive(pid) for pid in children), "dying", 1.0)
    assert graph.json("list") == {"tasks": [], "ports": []}
    assert list(Path(os.environ["SONAR_RUN_DIR"]).iterdir()) == []


def test_the_same_name_cannot_run_twice(graph: Any) -> None:
    graph.start(SOURCE)
    graph.wait_until_said("source: RUNNING")
    second = graph.sonar("run", graph.folder / "graph.yaml")
    assert second.returncode == 2
    assert "instance 'graph' is running already (process" in second.stderr
    with connect("source.pose_samples") as port:
        port.read()


def test_two_instances_do_not_see_each_other(graph: Any) -> None:
    graph.start(SOURCE, name="left.yaml")
    graph.start(SOURCE, name="right.yaml")
    graph.wait_for(lambda: len(graph.json("list")["tasks"]) == 2, "both running")
    with pytest.raises(SettingsError, match="say which: left/source, right/source"):
        connect("source.pose_samples", timeout=0.0)
    with connect("right/source.pose_samples") as port:
        port.read()


def test_properties_are_refused_with_the_reason_and_the_old_value_stays(graph: Any) -> None:
    graph.start(SOURCE)
    with connect_task("source", timeout=20.0) as source:
        graph.wait_for(lambda: source.state()["state"] == "RUNNING", "running")
        source.set("gain", 0.7)
        with pytest.raises(RuntimeError, match="gain: must be at most 1, got 2"):
            source.set("gain", 2)
        with pytest.raises(RuntimeError, match=r"source\.beams cannot change while the task is configured"):
            source.set("beams", 9)
        with pytest.raises(RuntimeError, match=r'no property .gian. \(did you mean "gain"\?\)'):
            source.set("gian", 0.1)
        assert source.get("gain") == 0.7
        assert source.command("stop")["state"] == "STOPPED"
        assert source.command("cleanup")["state"] == "PRE_OPERATIONAL"
        source.set("beams", 9)
        assert source.command("configure")["state"] == "STOPPED"
        assert source.command("start")["state"] == "RUNNING"
    with connect("source.sonar_samples") as port:
        assert port.read().beam_count == 9
