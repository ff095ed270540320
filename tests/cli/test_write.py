"""Writing to an input port from the command line."""

from __future__ import annotations

import time
from typing import Any

import pytest

OPEN = """
    version: 1
    tasks:
      recorder: {type: NumbersTask}
"""
POSE = "{position: [7, 0, -1], orientation: [1, 0, 0, 0]}"


@pytest.fixture
def recorder(graph: Any) -> Any:
    graph.start(OPEN)
    graph.wait_until_said("recorder: RUNNING")
    return graph


def test_a_sample_from_a_file_or_from_the_command_line_arrives(recorder: Any) -> None:
    file = recorder.write("position: [8, 0, 0]\norientation: [1, 0, 0, 0]\n", "pose.yaml")
    done = recorder.sonar("write", "recorder.poses", POSE)
    assert (done.returncode, done.stdout) == (0, "recorder.poses: 1 written, 1 received, 0 dropped\n"), done.stderr
    assert recorder.json("write", "recorder.poses", file)["received"] == 1
    assert recorder.json("call", "recorder.numbers") == [7, 8]


def test_a_rate_is_kept(recorder: Any) -> None:
    began = time.monotonic()
    found = recorder.json("write", "recorder.poses", POSE, "--rate", 20, "--count", 11)
    assert time.monotonic() - began >= 0.5  # ten periods of 50 ms
    assert (found["written"], found["received"], found["lost"]) == (11, 11, 0)
    assert recorder.json("call", "recorder.numbers") == [7] * 11


@pytest.mark.parametrize(
    ("sample", "message"),
    [
        ("{positon: [1, 2, 3]}", '1:2: positon: is not a field of RigidBodyState (did you mean "position"?)'),
        ("{position: [1, two, 3]}", "1:2: position: must be a list of numbers, got [1, 'two', 3]"),
        ("{position: 3}", "1:2: position: must be a list of numbers, got 3"),
        ("{time: soon}", "1:2: time: must be int, got 'soon'"),
        ("{position: [1, 2], orientation: [1, 0, 0, 0]}", "position must be 3 finite numbers [m], got [1.0, 2.0]"),
        ("{position: [1, 2, 3], orientation: [2, 0, 0, 0]}", "orientation must be a unit quaternion"),
        ("{position: [1, 2, 3]", "is not YAML"),
        ("nosuch.yaml", "nosuch.yaml: cannot be read: No such file or directory"),
    ],
)
def test_a_wrong_sample_is_one_line_and_is_not_sent(recorder: Any, sample: str, message: str) -> None:
    done = recorder.sonar("write", "recorder.poses", sample)
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1), done.stderr
    assert message in done.stderr
    assert recorder.json("call", "recorder.numbers") == []
