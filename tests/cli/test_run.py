"""`sonar run` and `sonar check` as a user types them."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import pytest

DEPLOY = Path(__file__).parents[2] / "deploy"
SOURCE = """
    version: 1
    tasks:
      source: {type: SourceTask}
"""


def test_seconds_end_a_run_with_exit_code_0(graph: Any) -> None:
    began = time.monotonic()
    done = graph.sonar("run", graph.write(SOURCE), "--seconds", 2)
    assert done.returncode == 0, done.stdout + done.stderr
    assert time.monotonic() - began >= 2
    assert "source: RUNNING" in done.stdout
    assert graph.processes() == []


def test_each_event_is_one_line_in_words(graph: Any) -> None:
    done = graph.sonar("run", graph.write(SOURCE), "--seconds", 2)
    assert [line.split(" ", 1)[1] for line in done.stdout.splitlines()] == ["source: RUNNING"]


def test_set_overrides_the_file_and_is_checked_like_it(graph: Any) -> None:
    file = graph.write(SOURCE)
    done = graph.sonar("run", file, "--set", "source.bins=0", "--seconds", 1)
    assert (done.returncode, done.stdout) == (2, "")
    assert "bins: must be at least 1, got 0" in done.stderr
    done = graph.sonar("run", file, "--set", "sorce.bins=1", "--seconds", 1)
    assert (done.returncode, "did you mean" in done.stderr) == (2, True)
    done = graph.sonar("run", file, "--set", "bins", "--seconds", 1)
    assert (done.returncode, "must be TASK.PROPERTY=VALUE" in done.stderr) == (2, True)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("version: 1\ntasks:\n  a: {type: SourceTsk}\n", "graph.yaml:3:7: tasks.a.type: 'SourceTsk' is not a known"),
        ("version: 1\ntasks:\n  a: {type: ViewerTask, process: a, process: b}\n", "3:37: tasks.a.process: stands"),
        ("version: 1\ntasks: [\n", "is not YAML"),
        ("version: 1\n", "tasks: is required"),
        ("", "must be a mapping"),
    ],
)  # fmt: skip
def test_a_wrong_file_is_refused_before_anything_starts(graph: Any, text: str, message: str) -> None:
    file = graph.write(text)
    for verb in ("run", "check"):
        done = graph.sonar(verb, file)
        assert (done.returncode, done.stdout) == (2, "")
        assert message in done.stderr
        assert "Traceback" not in done.stderr
        assert len(done.stderr.splitlines()) == 1


def test_a_missing_file_is_one_line(graph: Any) -> None:
    done = graph.sonar("run", "deplyo/demo.yaml")
    assert (done.returncode, "no such file" in done.stderr, len(done.stderr.splitlines())) == (2, True, 1)


def test_a_task_that_cannot_be_configured_says_why_and_fails_the_run(graph: Any) -> None:
    mesh = graph.folder / "broken.obj"
    mesh.write_text("this is no mesh")
    text = f"version: 1\ntasks:\n  scene: {{type: SceneTask, properties: {{world: {mesh}}}}}\n"
    done = graph.sonar("run", graph.write(text), "--seconds", 20)
    assert done.returncode == 1
    assert f"scene: PRE_OPERATIONAL: {mesh}" in done.stdout
    assert "no task could be started: stopping" in done.stdout
    assert "Traceback" not in done.stdout + done.stderr


def test_check_prints_the_plan_as_json(graph: Any) -> None:
    done = graph.sonar("check", graph.write(SOURCE), "--json")
    assert json.loads(done.stdout)["tasks"][0]["name"] == "source"


@pytest.mark.parametrize("file", sorted(DEPLOY.glob("*.yaml")), ids=lambda file: file.stem)
def test_every_deployment_of_the_gallery_is_good(graph: Any, file: Path) -> None:
    done = graph.sonar("check", file)
    assert done.returncode == 0, done.stderr
    assert "sonar run deploy/" in file.read_text()  # it begins with how to run it
