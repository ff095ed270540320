"""`sonar emulate` as a user types it: what is refused, in one line and with exit code 2, and what is said."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BALL = "version: 1\nbodies:\n  ball: {sphere: {radius: 1 m}, pose: {position: [5 m, 0, 0]}}\n"
FREE = ("--udp", "127.0.0.1:0", "--discovery", "127.0.0.1:0")


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    file = tmp_path / "ball.yaml"
    file.write_text(BALL)
    return file


def sonar(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "sonar_component", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("ping360", "--udp", "127.0.0.1"), "--udp: udp: must be HOST:PORT with a port of 0 to 65535"),
        (("ping360", "--udp", "127.0.0.1:70000"), "got '127.0.0.1:70000'"),
        (("ping360", "--udp", "sonar.local:1"), "must begin with an IPv4 address or localhost"),
        (("ping360", "--udp", "0.0.0.0:12345"), "must be at 127.0.0.1, or allow_remote must be true as well"),
        (("ping360", *FREE, "--set", "overhed=1 ms"), 'overhed: is not a known key (did you mean "overhead"?)'),
        (("ping360", *FREE, "--set", "overhead=1 m"), "is of length"),
        (("ping360", *FREE, "--set", "firmware=new"), "must be three numbers of 0 to 255 with dots"),
        (("ping360", *FREE, "--rpy-deg", "nan", "0", "0"), "orientation"),
        (("oculus", "--tcp", "1.2.3.4:52100"), "must be at 127.0.0.1"),
        (("oculus", "--status-to", "255.255.255.255:52102"), "must be at 127.0.0.1"),
        (("oculus", "--tcp", "127.0.0.1:0", "--log", "/nowhere/x.oculus"), "No such file or directory; choose another"),
        (("micron", "--pty", "/nowhere/tty"), "No such file or directory"),
        (("micron",), "--pty"),
        (("ping361",), "ping361"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line_and_exit_code_2(scene: Path, arguments: tuple[str, ...], said: str) -> None:
    done = sonar("emulate", *arguments, "--scene", scene)
    assert (done.returncode, done.stdout) == (2, "")
    assert said in done.stderr
    assert len(done.stderr.splitlines()) == 1, done.stderr


def test_a_scene_that_is_not_there_is_said() -> None:
    done = sonar("emulate", "ping360", *FREE, "--scene", "nowhere.yaml")
    assert (done.returncode, "nowhere.yaml" in done.stderr) == (2, True)


def test_an_address_that_somebody_has_is_said(scene: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        done = sonar("emulate", "ping360", "--udp", address, "--scene", scene)
        assert done.returncode == 2
        assert f"udp: {address}: Address already in use" in done.stderr
        # Of discovery one a computer is enough: the endpoint goes on without.
        done = sonar(
            "emulate", "ping360", "--udp", "127.0.0.1:0", "--discovery", address, "--scene", scene, "--seconds", 0
        )
        assert done.returncode == 0
        assert "without discovery" in done.stderr


def test_seconds_end_it_and_it_says_how_punctual_it_was(scene: Path) -> None:
    done = sonar("emulate", "ping360", *FREE, "--scene", scene, "--seconds", 0.2)
    assert done.returncode == 0, done.stderr
    first, last = done.stdout.splitlines()
    assert first.startswith("Ping360-compatible endpoint at udp 127.0.0.1:")
    assert last == "no client asked for a ping"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_ends_it_in_order(scene: Path, tmp_path: Path, number: int) -> None:
    line = tmp_path / "tty"
    command = [sys.executable, "-m", "sonar_component", "emulate", "micron", "--pty", line, "--scene", scene, "--json"]
    with subprocess.Popen([*map(str, command)], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert json.loads(process.stdout.readline()) == {"endpoint": "Micron", "at": f"serial line {line}"}
        process.send_signal(number)
        assert json.loads(process.stdout.readline())["timing"]["pings"] == 0
        assert process.wait(20) == 0
    assert not os.path.lexists(line)


def test_what_other_computers_can_reach_is_said(scene: Path) -> None:
    done = sonar(
        "emulate", "ping360", "--udp", "0.0.0.0:0", "--discovery", "127.0.0.1:0", "--allow-remote", "--scene", scene,
        "--seconds", 0,
    )  # fmt: skip
    assert done.returncode == 0
    assert "warning: other computers can reach udp 0.0.0.0:0" in done.stderr


def test_properties_come_from_a_file_and_wrong_ones_are_found_at_their_line(scene: Path, tmp_path: Path) -> None:
    file = tmp_path / "beam.yaml"
    file.write_text("beam_width: 1 deg\nbeam_heigth: 20 deg\n")
    done = sonar("emulate", "ping360", *FREE, "--scene", scene, "--sonar", file)
    assert done.returncode == 2
    assert f'{file}:2:1: beam_heigth: is not a known key (did you mean "beam_height"?)' in done.stderr
