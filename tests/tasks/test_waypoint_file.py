"""Trajectory files: what they may look like, and one line for each mistake."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from sonar_component.samples.rigid_body_state import quaternion_from_rpy
from sonar_component.settings import SettingsError
from sonar_component.tasks.waypoint_file import read_waypoints


def read(tmp_path: Path, text: str, name: str = "path.csv", longest_gap: float = 60.0) -> tuple[np.ndarray, ...]:
    file = tmp_path / name
    file.write_text(text)
    return read_waypoints(file, longest_gap)


def test_csv_has_units_in_its_header_and_counts_time_from_its_first_pose(tmp_path: Path) -> None:
    times, positions, orientations = read(
        tmp_path,
        "# a turn\ntime [ms], x [cm], y, z [m], yaw [deg], roll, pitch\n\n500,100,2,-3,90,0,0\n1500,0,0,0,0,0,0\n",
    )
    assert times.tolist() == [0.0, 1.0]
    assert positions[0].tolist() == [1.0, 2.0, -3.0]
    assert np.allclose(orientations[0], quaternion_from_rpy(0, 0, math.pi / 2))


def test_csv_may_hold_quaternions_or_no_orientation_at_all(tmp_path: Path) -> None:
    _, _, orientations = read(tmp_path, "time,qw,qx,qy,qz\n0,0.7071,0,0,0.7071\n")
    assert np.linalg.norm(orientations[0]) == pytest.approx(1.0)
    _, positions, orientations = read(tmp_path, "time,x\n0,1\n1,2\n")
    assert orientations.tolist() == [[1, 0, 0, 0]] * 2
    assert positions[:, 0].tolist() == [1, 2]


def test_yaml_says_the_same(tmp_path: Path) -> None:
    text = """
version: 1
points:
  - {time: 0 s, position: [1 m, 0, 0]}
  - {time: 2 s, rpy: [0, 0, 20 deg]}
"""
    times, positions, orientations = read(tmp_path, text, "path.yaml")
    assert times.tolist() == [0, 2]
    assert positions.tolist() == [[1, 0, 0], [0, 0, 0]]
    assert np.allclose(orientations[1], quaternion_from_rpy(0, 0, math.radians(20)))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time,x\n0,0\n2,1\n1,2\n", r"path.csv:4: time: time must grow: 1 s comes after 2 s in line 3"),
        ("time,x\n0,0\n0,1\n", r"path.csv:3: time: time must grow"),
        ("time,x\n0,0\n100,1\n", r"path.csv:3: time: gap of 100 s after line 2; allowed 60 s \(max_gap\)"),
        ("time,x\n0,nan\n", r"path.csv:2: x: must be a number"),
        ("time,x\n0,1e999\n", r"path.csv:2: time and pose must be finite"),
        ("time,x\n0,\n", r"path.csv:2: x: must be a number"),
        ("time,x\n0,1,2\n", r"path.csv:2: must have 2 values, got 3"),
        ("time,xx\n0,1\n", r"path.csv:1: 'xx' is not a column"),
        ("x,y\n0,1\n", r"path.csv:1: columns lack time"),
        ("time,roll\n0,1\n", r"path.csv:1: columns lack pitch, yaw"),
        ("time,x,x\n0,1,1\n", r"path.csv:1: columns name something twice"),
        ("time,x [deg]\n0,1\n", r"path.csv:2: x: must be of length.*is of angle"),
        ("time,qw,qx,qy,qz\n0,1,1,0,0\n", r"path.csv:2: quaternion .* must have length 1, got 1.41421"),
        ("time,x\n", r"path.csv: must have a line of column names and at least one pose"),
        ("", r"path.csv: must have a line of column names"),
    ],
)
def test_each_mistake_has_its_line(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(SettingsError, match=words):
        read(tmp_path, text)


def test_mistakes_in_yaml_have_their_line_too(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"path.yaml:4: time: time must grow"):
        read(tmp_path, "version: 1\npoints:\n  - {time: 1 s}\n  - {time: 0 s}\n", "path.yaml")
    with pytest.raises(SettingsError, match=r"path.yaml:3.*rpy or quaternion"):
        read(tmp_path, "version: 1\npoints:\n  - {time: 1, rpy: [0, 0, 0], quaternion: [1, 0, 0, 0]}\n", "path.yaml")
    with pytest.raises(SettingsError, match="cannot be read"):
        read_waypoints(tmp_path / "none.csv", 60.0)
