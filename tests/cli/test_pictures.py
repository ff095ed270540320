"""`sonar snapshot`, `sonar view` and `sonar echo --plot` on running graphs."""

from __future__ import annotations

import json

from PIL import Image

SOURCE = """
version: 1
tasks:
  source: {type: SourceTask, properties: {beams: 32, bins: 50}}
"""
WITH_VIEWER = """
version: 1
tasks:
  source: {type: SourceTask, properties: {beams: 32, bins: 50}}
  viewer: {type: ViewerTask, properties: {port: PORT}}
connections:
  - {from: source.sonar_samples, to: [viewer.sonar_samples]}
"""


def test_a_snapshot_is_a_picture_with_title_and_settings(graph, tmp_path):
    graph.start(SOURCE)
    graph.wait_until_said("source: RUNNING")
    out = tmp_path / "a.png"
    done = graph.sonar("snapshot", "source.sonar_samples", "--out", out, "--json")
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    assert facts["file"] == str(out)
    assert facts["shows"].startswith("32 x 50")
    with Image.open(out) as picture:
        assert picture.text["Title"] == "source.sonar_samples"
        assert picture.width == 900
    polar = graph.sonar(
        "snapshot", "source.sonar_samples", "--out", tmp_path / "b.png", "--view", "polar", "--map", "gray"
    )
    assert polar.returncode == 0, polar.stderr


def test_bad_input_is_one_line_and_exit_code_2(graph, tmp_path):
    graph.start(SOURCE)
    graph.wait_until_said("source: RUNNING")
    out = tmp_path / "a.png"
    cases = {
        ("source.sonar_sample", out): "sonar_samples",  # the nearest name
        ("source.state", out): "TaskState",
        ("source", out): "TASK.PORT",
        ("source.sonar_samples", tmp_path / "a.jpg"): ".png",
        ("source.sonar_samples", tmp_path / "no" / "a.png"): "there is no folder",
    }
    for (port, path), expected in cases.items():
        done = graph.sonar("snapshot", port, "--out", path, "--timeout", 1)
        assert done.returncode == 2, (port, done.stdout, done.stderr)
        assert expected in done.stderr
        assert len(done.stderr.strip().splitlines()) == 1
        assert not out.exists()


def test_a_port_that_sends_nothing_is_exit_code_1(graph, tmp_path):
    graph.start(SOURCE)
    graph.wait_until_said("source: RUNNING")
    assert graph.sonar("state", "source", "stop").returncode == 0
    done = graph.sonar("snapshot", "source.sonar_samples", "--out", tmp_path / "a.png", "--timeout", 0.5)
    assert done.returncode == 1, done.stderr
    assert "no sample on source.sonar_samples" in done.stderr


def test_view_says_where_the_page_is_and_the_page_is_there(graph):
    import urllib.request

    graph.start(WITH_VIEWER.replace("PORT", "0"))
    graph.wait_until_said("viewer: RUNNING")
    page = graph.json("view")["page"]
    with urllib.request.urlopen(page, timeout=10) as answer:
        assert answer.status == 200
    assert graph.sonar("view", "--no-browser").stdout.strip() == page


def test_a_viewer_that_hangs_or_is_killed_does_not_slow_the_sonar(graph):
    import os
    import signal

    graph.start(WITH_VIEWER.replace("PORT", "0"))
    graph.wait_until_said("viewer: RUNNING")
    pid = next(task["pid"] for task in graph.json("list")["tasks"] if task["task"] == "viewer")
    before = graph.json("hz", "source.sonar_samples", "--seconds", 1)["hz"]
    os.kill(pid, signal.SIGSTOP)
    hung = graph.json("hz", "source.sonar_samples", "--seconds", 2)["hz"]
    os.kill(pid, signal.SIGKILL)
    killed = graph.json("hz", "source.sonar_samples", "--seconds", 1)["hz"]
    # The source writes 50 a second; the machine of a test run has other work, which costs it some of them.
    assert hung > 0.6 * before
    assert killed > 0.6 * before


def test_without_a_viewer_view_says_what_is_missing(graph):
    graph.start(SOURCE)
    graph.wait_until_said("source: RUNNING")
    done = graph.sonar("view")
    assert done.returncode == 1
    assert "ViewerTask" in done.stderr
    elsewhere = graph.sonar("view", "--instance", "nowhere")
    assert (elsewhere.returncode, elsewhere.stderr) == (2, "no instance 'nowhere' is running; see: sonar list\n")


def test_echo_draws_the_image_in_plain_characters_into_a_pipe(graph):
    graph.start(SOURCE)
    graph.wait_until_said("source: RUNNING")
    done = graph.sonar("echo", "source.sonar_samples", "-n", 1, "--plot")
    assert done.returncode == 0, done.stderr
    assert "\x1b" not in done.stdout
    drawn = [line for line in done.stdout.splitlines() if line and set(line) <= set(" .:-=+*#%@?")]
    assert len(drawn) > 5
    assert graph.sonar("echo", "source.state", "-n", 1, "--plot").returncode == 2
