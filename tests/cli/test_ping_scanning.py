"""`sonar ping` of a scanning sonar, as a user types it, on real OpenGL."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from sonar_component.cli.app import main

SCENE = """\
version: 1
bodies:
  ball: {sphere: {radius: 0.5 m}, pose: {position: [0, 6 m, 0]}}
"""
SONAR = """\
kind: scanning
range: 10 m
bin_count: 100
motor_step: 10 deg
beam_width: 10 deg
unverified: [motor_step]
"""
Typed = Callable[..., tuple[int, str, str]]


@pytest.fixture
def ping(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Typed:
    (tmp_path / "scene.yaml").write_text(SCENE)
    (tmp_path / "sonar.yaml").write_text(SONAR)

    def typed(*arguments: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as caught:
            main(["ping", "--scene", str(tmp_path / "scene.yaml"), "--sonar", str(tmp_path / "sonar.yaml"),
                  *map(str, arguments)])  # fmt: skip
        printed = capsys.readouterr()
        assert isinstance(caught.value.code, int)
        return caught.value.code, printed.out, printed.err

    return typed


def test_one_ping_looks_where_it_is_told_and_says_what_no_source_confirms(ping: Typed, tmp_path: Path) -> None:
    code, out, err = ping("--bearing-deg", 90, "--out", tmp_path / "one.npz")
    assert code == 0
    assert "1 beams x 100 bins" in out
    assert "motor_step is our estimate: no source states the device's own" in err
    with np.load(tmp_path / "one.npz") as file:
        assert file["bins"].shape == (1, 100)
        assert math.degrees(file["bearings"][0]) == pytest.approx(90)
        assert abs(np.flatnonzero(file["bins"][0])[0] - 55) <= 1  # the ball begins at 5.5 m, on the edge of a bin
    assert ping("--out", tmp_path / "ahead.npz")[0] == 0
    with np.load(tmp_path / "ahead.npz") as file:
        assert not file["bins"].any()


def test_a_bearing_between_two_steps_is_taken_exactly(ping: Typed, tmp_path: Path) -> None:
    sector = ["--set", "continuous=false", "--set", "left_limit=-20 deg", "--set", "right_limit=20 deg"]
    assert ping(*sector, "--bearing-deg", 83.5, "--out", tmp_path / "one.npz")[0] == 0
    with np.load(tmp_path / "one.npz") as file:
        assert math.degrees(file["bearings"][0]) == pytest.approx(83.5)
        assert file["bins"].any()


def test_a_scan_holds_every_direction_from_left_to_right(ping: Typed, tmp_path: Path) -> None:
    code, out, _ = ping("--scan", "--json", "--out", tmp_path / "scan.npz")
    assert code == 0
    assert json.loads(out)["beam_count"] == 36
    with np.load(tmp_path / "scan.npz") as file:
        lit = np.degrees(file["bearings"][file["bins"].any(axis=1)])
        assert (np.diff(file["bearings"]) < 0).all()
        assert np.abs(lit - 90).max() <= 10  # the ball spans +-4.8 deg: the beam on it and those beside
        assert file["beam_width"] == pytest.approx(2 * math.pi)
    assert ping("--scan", "--noise", "on", "--out", tmp_path / "scan.png")[0] == 0
    with Image.open(tmp_path / "scan.png") as picture:
        assert min(picture.size) > 300


def test_truth_of_one_beam_names_the_body(ping: Typed, tmp_path: Path) -> None:
    assert ping("--bearing-deg", 90, "--truth", "--out", tmp_path / "one.npz")[0] == 0
    with np.load(tmp_path / "one.npz") as file:
        lit = file["bins"][0] > 0
        assert set(file["object_names"][file["object_id"][0, lit] - 1]) == {"ball"}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--scan", "--bearing-deg", "3"], "--scan does not go with --bearing-deg"),
        (["--scan", "--truth"], "--scan does not go with --truth"),
        (["--bearing-deg", "900"], "--bearing-deg must be -360 to 360, got 900"),
        (["--set", "motor_step=0 deg"], "motor_step: must be 0.01 deg to 90 deg, got 0 deg"),
        (["--set", "kind=sideways"], "kind: must be forward_looking or scanning, got 'sideways'"),
        (["--set", "beam_count=3"], "beam_count"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(
    ping: Typed, tmp_path: Path, arguments: list[str], words: str
) -> None:
    code, _, err = ping(*arguments, "--out", tmp_path / "x.npz")
    assert code == 2
    assert words in err
    assert len(err.strip().splitlines()) == 1


def test_a_forward_looking_sonar_has_no_head(ping: Typed, tmp_path: Path) -> None:
    (tmp_path / "sonar.yaml").write_text("range: 10 m\n")
    for option in (["--scan"], ["--bearing-deg", "3"]):
        code, _, err = ping(*option, "--out", tmp_path / "x.npz")
        assert code == 2
        assert "is for scanning sonars; the settings are of kind forward_looking" in err
