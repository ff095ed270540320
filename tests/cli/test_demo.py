"""The demo as a user meets it: real processes, real OpenGL, another process that reads the port; and its faults."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

DEMO = (Path(__file__).parents[2] / "deploy" / "demo.yaml").read_text()
COMPILING = 60.0  # [s], patience for a first frame on a busy machine: the first start compiles the binning loop
# Shares nothing with the sonar but the port.
READER = """
import json
from sonar_component.middleware import connect

with connect("fls.sonar_samples", policy="buffer", size=8, timeout=60) as port:
    samples = [port.read() for _ in range(5)]
for sample in samples:
    sample.validate()
print(json.dumps({
    "times": [s.time for s in samples],
    "shape": samples[0].bins.shape,
    "lit": [float((s.bins > 0).mean()) for s in samples],
    "greatest": max(float(s.bins.max()) for s in samples),
    "left": samples[0].bearings[0],
}))
"""


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def taken_port() -> Iterator[int]:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        yield int(taken.getsockname()[1])


def test_another_process_reads_the_images_of_the_demo(context: Any, graph: Any, tmp_path: Path) -> None:
    pictures = tmp_path / "out"
    settings = ("--set", f"viewer.port={free_port()}", "--set", f"viewer.snapshot_dir={pictures}")
    launcher = graph.start(DEMO, *settings)
    graph.wait_for(lambda: (pictures / "fls_sonar_samples_first.png").exists(), "the first picture", COMPILING)

    done = subprocess.run(
        [sys.executable, "-c", READER], env=graph.environment, capture_output=True, text=True, timeout=90, check=True
    )
    seen = json.loads(done.stdout)
    assert seen["shape"] == [256, 500]
    assert seen["times"] == sorted(set(seen["times"]))  # each pose makes one image
    assert all(0.1 < lit < 0.9 for lit in seen["lit"])  # wreck and sand, and shadows
    assert seen["greatest"] > 0.5
    assert seen["left"] > 0

    rate = graph.json("hz", "fls.sonar_samples")
    # One image per pose, ten poses a second; a busy machine may lose some, never add any.
    assert 2 < rate["hz"] < 11.5
    assert "fls.sonar_samples" in graph.json("list")["ports"]
    shot = tmp_path / "shot.png"
    assert graph.sonar("snapshot", "fls.sonar_samples", "--out", shot).returncode == 0
    with Image.open(shot) as picture:
        assert min(picture.size) > 300

    launcher.send_signal(signal.SIGINT)  # Ctrl-C
    assert launcher.wait(30) == 0, graph.said()
    assert graph.processes() == []
    assert "Traceback" not in graph.said()


def test_no_process_outlives_a_launcher_that_is_killed(context: Any, graph: Any) -> None:
    launcher = graph.start(DEMO, "--set", f"viewer.port={free_port()}")
    graph.wait_until_said("RUNNING", times=4)
    assert len(graph.processes()) >= 4
    launcher.kill()
    launcher.wait()
    graph.wait_for(lambda: not graph.processes(), "the end of all processes")


def test_a_taken_port_is_an_error_state_that_names_it(graph: Any) -> None:
    with taken_port() as port:
        graph.start(DEMO, "--set", f"viewer.port={port}")
        graph.wait_until_said(f"viewer: RUNTIME_ERROR PORT_IN_USE: http://127.0.0.1:{port}: ")
    assert "Traceback" not in graph.said()


def test_without_egl_the_sonar_says_so_and_the_others_run(graph: Any, tmp_path: Path) -> None:
    graph.environment["__EGL_VENDOR_LIBRARY_DIRS"] = str(tmp_path)  # a machine without drivers
    launcher = graph.start(DEMO, "--set", f"viewer.port={free_port()}")
    graph.wait_until_said("fls: PRE_OPERATIONAL: no headless OpenGL 4.3 through EGL")
    assert "sudo apt-get install libegl1" in graph.said()
    graph.wait_until_said("scene: RUNNING")
    launcher.send_signal(signal.SIGINT)
    assert launcher.wait(30) == 1, graph.said()  # something failed while running
    assert "Traceback" not in graph.said()


def test_a_mesh_that_is_gone_is_an_error_state_that_names_file_line_and_key(graph: Any) -> None:
    (graph.folder / "scene.yaml").write_text("version: 1\nbodies:\n  wreck: {mesh: gone.glb}\n")
    text = DEMO.replace("configs/scenes/wreck_site/scene.yaml", "scene.yaml")
    graph.start(text, "--set", f"viewer.port={free_port()}")
    graph.wait_until_said(
        f"scene: PRE_OPERATIONAL: {graph.folder}/scene.yaml:3:11: bodies.wreck.mesh: gone.glb: no such"
    )
    assert "Traceback" not in graph.said()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("activity: {periodic", "actvity: {periodic", 'is not a known key (did you mean "activity"?)'),
        ("{world: configs/scenes/wreck_site", "{world: configs/scenes/wrekc_site", "tasks.scene.properties.world: "),
        ("14 m, -1 m", "14 m, .nan", "tasks.pose.properties.position.1: "),
        ("radius: 17 m", "radius: 17 deg", "radius: must be of length (m, mm, cm, km): 'deg' is of angle"),
        ("{accuracy: 0.05}", "{range: 0 m}", "range: must be 0.1 m to 1000 m"),
        ("configs/sonars/gemini_720i", "configs/sonars/gemini_720", 'no such file (did you mean "gemini_720i.yaml"?)'),
        ("from: fls.sonar_samples", "from: fls.sonar_sample", '(did you mean "sonar_samples"?)'),
        ("type: ViewerTask", "type: ViwerTask", 'is not a known task type (did you mean "ViewerTask"?)'),
    ],
)  # fmt: skip
def test_a_mistake_in_the_deployment_stops_it_before_any_process_starts(
    graph: Any, old: str, new: str, message: str
) -> None:
    assert DEMO.count(old) == 1
    file = graph.write(DEMO.replace(old, new))
    done = graph.sonar("run", file, "--seconds", 1)
    assert (done.returncode, done.stdout) == (2, "")
    assert message in done.stderr
    assert done.stderr.startswith(f"{graph.folder}/graph.yaml:")
    assert done.stderr.count("\n") == 1
