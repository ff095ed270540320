"""Asking running tasks from another shell."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest

DEPLOY = Path(__file__).parents[2] / "deploy"
CHAIN = """
    version: 1
    tasks:
      pose: {type: SourceTask}
      fls: {type: PoseToSonarTask, properties: {beams: 256, bins: 500}}
    connections:
      - {from: pose.pose_samples, to: fls.sonar_pose_cmd}
"""


def running(graph: Any) -> Any:
    graph.start(CHAIN)
    for task in ("pose", "fls"):
        graph.wait_until_said(f"{task}: RUNNING")
    return graph


def test_properties_are_read_and_set(graph: Any) -> None:
    running(graph)
    assert graph.json("get", "pose.gain") == 0.5
    assert graph.sonar("set", "pose.gain", "0.25").returncode == 0
    assert graph.sonar("get", "pose").stdout == "beams = 4\nbins = 8\ngain = 0.25\n"
    for value, message in (("7", "gain: must be at most 1, got 7"), ("loud", "gain: must be a valid number")):
        done = graph.sonar("set", "pose.gain", value)
        assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
        assert message in done.stderr
    assert graph.json("get", "pose.gain") == 0.25


def test_operations_are_called(graph: Any) -> None:
    running(graph)
    assert graph.json("call", "pose.rendered_count") == 0
    done = graph.sonar("call", "pose.rendered")
    assert (done.returncode, "it has: die, hang, rendered_count" in done.stderr) == (2, True)
    done = graph.sonar("call", "pose.hang", "seconds=long")
    assert (done.returncode, "pose.hang(seconds" in done.stderr) == (2, True)


def test_states_are_shown_and_ordered(graph: Any) -> None:
    running(graph)
    assert graph.json("state", "pose")["state"] == "RUNNING"
    assert graph.json("state", "pose", "stop")["state"] == "STOPPED"
    done = graph.sonar("state", "pose", "stop")
    assert (
        done.returncode,
        "stop is not allowed in STOPPED; allowed there: configure, start, cleanup" in done.stderr,
    ) == (1, True)
    assert graph.json("state", "pose", "start")["state"] == "RUNNING"


def test_inspect_shows_what_became_of_every_sample(graph: Any) -> None:
    running(graph)

    def received() -> dict[str, Any]:
        return dict(graph.json("inspect", "fls")["inputs"]["sonar_pose_cmd"]["connections"][0])

    line = graph.wait_for(lambda: (found := received())["received"] > 0 and found, "receiving")
    found = graph.json("inspect", "fls")
    assert (line["dropped"], line["lost"], line["restarts"], line["rejected"]) == (0, 0, 0, {})
    assert found["outputs"]["sonar_samples"]["endpoint"].startswith("ipc://")
    text = graph.sonar("inspect", "fls").stdout
    assert f"process {found['process']}, pid {found['pid']})" in text.splitlines()[0]
    assert isinstance(found["process"], str)
    assert found["costs"]["memory"] > 1e6  # [bytes], of a Python process
    assert "property  beams = 256" in text


def test_the_running_graph_has_rates_on_its_edges(graph: Any) -> None:
    (edge,) = running(graph).json("graph", "--seconds", 2)["connections"]
    assert (edge["source"], edge["target"], edge["lost"]) == ("pose.pose_samples", "fls.sonar_pose_cmd", 0)
    assert abs(edge["rate"] - 50) < 5  # the two questions may take some 0.1 s each on a busy machine


def test_top_shows_what_tasks_cost(graph: Any) -> None:
    rows = running(graph).json("top")
    assert {row["task"] for row in rows} == {"pose", "fls"}
    assert all(row["memory_mb"] > 5 and row["cpu"] < 100 for row in rows)
    heads, *lines = graph.sonar("top", "--once").stdout.splitlines()
    assert heads.split()[:3] == ["task", "state", "cycles/s"]
    assert [line.split()[:2] for line in lines] == [["fls", "RUNNING"], ["pose", "RUNNING"]]


@pytest.mark.parametrize("file", sorted(DEPLOY.glob("*.yaml")), ids=lambda file: file.stem)
def test_every_deployment_can_be_drawn(graph: Any, file: Path) -> None:
    picture = graph.folder / "graph.svg"
    done = graph.sonar("graph", file, "--out", picture)
    assert done.returncode == 0, done.stderr
    texts = [element.text for element in ET.fromstring(picture.read_text()).iter() if element.tag.endswith("text")]
    plan = json.loads(graph.sonar("check", file, "--json").stdout)
    assert {task["name"] for task in plan["tasks"]} <= set(texts)


def test_the_schema_knows_tasks_and_their_properties(graph: Any) -> None:
    schema = json.loads(graph.sonar("schema").stdout)
    assert "SourceTask" in schema["$defs"]["TaskFile"]["properties"]["type"]["enum"]
    assert "gain" in schema["$defs"]["SourceTask.properties"]["properties"]
    assert schema["$defs"]["ConnectionFile"]["properties"].keys() == {"from", "to", "policy", "max_age"}
