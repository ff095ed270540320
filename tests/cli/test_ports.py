"""Looking at a running graph from another shell."""

from __future__ import annotations

import json
from typing import Any

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


def test_list_names_tasks_states_and_ports(graph: Any) -> None:
    found = running(graph).json("list")
    assert [(task["task"], task["state"]) for task in found["tasks"]] == [("fls", "RUNNING"), ("pose", "RUNNING")]
    assert set(found["ports"]) == {
        "fls.state",
        "fls.sonar_samples",
        "pose.state",
        "pose.sonar_samples",
        "pose.pose_samples",
    }


def test_list_with_nothing_running_says_how_to_start(graph: Any) -> None:
    done = graph.sonar("list")
    assert (done.returncode, done.stdout) == (0, "nothing is running; start a deployment with: sonar run FILE\n")
    assert graph.json("list") == {"tasks": [], "ports": []}


def test_hz_reports_the_rate_of_the_task(graph: Any) -> None:
    found = running(graph).json("hz", "fls.sonar_samples", "--seconds", 2)
    # 50 Hz by deadlines; the two ends of the window are uncertain by one period each, hence 2 of 100.
    assert abs(found["hz"] - 50) < 1.5
    assert found["lost"] == 0


def test_echo_prints_statistics_of_arrays_and_never_the_array(graph: Any) -> None:
    done = running(graph).sonar("echo", "fls.sonar_samples", "-n", 1)
    assert "bins: float32 256 x 500  min 0, mean 0, max 0" in done.stdout
    assert len(done.stdout) < 2000
    lines = graph.sonar("echo", "pose.pose_samples", "-n", 2, "--json").stdout.splitlines()
    assert [json.loads(line)["position"] for line in lines] == [[0, 0, 0]] * 2


def test_a_wrong_name_is_one_line_with_the_nearest(graph: Any) -> None:
    running(graph)
    for name, message in (
        ("fls.sonar_sample", "fls has no output port 'sonar_sample' (did you mean \"sonar_samples\"?)"),
        ("fsl.sonar_samples", "no task 'fsl' is running (did you mean \"fls\"?)"),
        ("fls.sonar_pose_cmd", "it is an input"),
        ("fls", "must be TASK.PORT, got 'fls'"),
    ):
        done = graph.sonar("hz", name, "--timeout", 0.1)
        assert (done.returncode, len(done.stderr.splitlines())) == (2, 1), done.stderr
        assert message in done.stderr


def test_bw_and_delay_read_headers_and_agree_with_the_sizes(graph: Any) -> None:
    found = running(graph).json("bw", "fls.sonar_samples", "--seconds", 1)
    arrays = 256 * 500 * 4 + 256 * 8 + 3 * 8 + 4 * 8  # bins, bearings, sensor pose
    assert found["mean_bytes"] == arrays
    delays = graph.json("delay", "fls.sonar_samples", "--seconds", 1)
    assert 0 < delays["transport_ms"]["median"] < 100
    assert delays["age_ms"]["median"] >= delays["transport_ms"]["median"]
