"""Trajectory files: poses with their times, as CSV or YAML. Every mistake has its line.

CSV, units in square brackets, SI where there are none; either roll, pitch, yaw or qw, qx, qy, qz, or neither:

    time [s], x [m], y [m], z [m], roll [deg], pitch [deg], yaw [deg]
    0, 0, 0, 0, 0, 0, 0

YAML:

    version: 1
    points:
      - {time: 0 s, position: [0, 0, 0], rpy: [0, 0, 20 deg]}
"""

from __future__ import annotations

import csv
import math
import re
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from sonar_component.samples.rigid_body_state import quaternion_from_rpy
from sonar_component.settings import SettingsError, load_yaml, parse, validate
from sonar_component.settings.errors import suggest
from sonar_component.settings.quantity import Angle, Duration, Length
from sonar_component.tasks.waypoints import Array

_UNIT_TOLERANCE = 1e-3  # [-], of a quaternion's length: what three decimals leave
_COLUMNS = {"time": "duration", "x": "length", "y": "length", "z": "length"}
_ANGLES = {"roll": "angle", "pitch": "angle", "yaw": "angle"}
_QUATERNION = {"qw": "ratio", "qx": "ratio", "qy": "ratio", "qz": "ratio"}
_KNOWN = _COLUMNS | _ANGLES | _QUATERNION
_HEADER = re.compile(r"\s*(\w+)\s*(?:\[\s*(.*?)\s*\])?\s*$")


class Point(NamedTuple):
    """One pose: time [s], position [m], orientation (w, x, y, z), and its line in the file."""

    time: float
    position: Array
    orientation: Array
    line: int


class _PointModel(BaseModel):
    model_config = ConfigDict(extra="forbid", defer_build=True)

    time: Annotated[Duration, Field(allow_inf_nan=False)]
    position: tuple[Length, Length, Length] = (0.0, 0.0, 0.0)
    rpy: tuple[Angle, Angle, Angle] | None = None
    quaternion: tuple[float, float, float, float] | None = None

    @model_validator(mode="after")
    def _one_orientation(self) -> _PointModel:
        if self.rpy is not None and self.quaternion is not None:
            raise ValueError("give rpy or quaternion, got both")
        return self


class _FileModel(BaseModel):
    model_config = ConfigDict(extra="forbid", defer_build=True)

    version: Literal[1]
    points: Annotated[list[_PointModel], Field(min_length=1)]


def read_waypoints(path: Path, longest_gap: float) -> tuple[Array, Array, Array]:
    """Times (n,) from the first pose on [s], positions (n, 3) [m], orientations (n, 4).

    Raises
    ------
    SettingsError
        If a value is missing or not finite, time does not grow, two poses are further apart than `longest_gap` [s], or
        a quaternion is none.
    """
    points = _from_yaml(path) if path.suffix in (".yaml", ".yml") else _from_csv(path)
    for point in points:
        _check(path, point)
    for earlier, later in pairwise(points):
        _check_pair(path, earlier, later, longest_gap)
    orientations = np.array([p.orientation / np.linalg.norm(p.orientation) for p in points])
    times = np.array([p.time - points[0].time for p in points])
    return times, np.array([p.position for p in points]), orientations


def _check(path: Path, point: Point) -> None:
    if not (math.isfinite(point.time) and np.isfinite(point.position).all() and np.isfinite(point.orientation).all()):
        raise SettingsError("time and pose must be finite numbers", str(path), point.line)
    length = float(np.linalg.norm(point.orientation))
    if abs(length - 1) > _UNIT_TOLERANCE:
        raise SettingsError(f"quaternion (w, x, y, z) must have length 1, got {length:.6g}", str(path), point.line)


def _check_pair(path: Path, earlier: Point, later: Point, longest_gap: float) -> None:
    if later.time <= earlier.time:
        before = f"{earlier.time:g} s in line {earlier.line}"
        raise SettingsError(f"time must grow: {later.time:g} s comes after {before}", str(path), later.line, key="time")
    if later.time - earlier.time > longest_gap:
        message = (
            f"gap of {later.time - earlier.time:g} s after line {earlier.line}; allowed {longest_gap:g} s (max_gap)"
        )
        raise SettingsError(message, str(path), later.line, key="time")


def _from_yaml(path: Path) -> list[Point]:
    document = load_yaml(path)
    points = validate(_FileModel, document).points
    return [
        Point(
            p.time,
            np.array(p.position),
            np.array(p.quaternion) if p.quaternion is not None else quaternion_from_rpy(*(p.rpy or (0.0, 0.0, 0.0))),
            document.position(("points", number))[0],
        )
        for number, p in enumerate(points)
    ]


def _from_csv(path: Path) -> list[Point]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise SettingsError(f"cannot be read: {getattr(error, 'strerror', None) or error}", str(path)) from None
    rows = [
        (number, row)
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
        for row in csv.reader([line])
    ]
    if len(rows) < 2:
        raise SettingsError("must have a line of column names and at least one pose", str(path))
    columns = _header(path, *rows[0])
    return [_point(path, number, row, columns) for number, row in rows[1:]]


def _header(path: Path, line: int, row: list[str]) -> list[tuple[str, str]]:
    """Name and unit of each column."""
    columns = []
    for cell in row:
        match = _HEADER.match(cell)
        name = match[1] if match else cell.strip()
        if match is None or name not in _KNOWN:
            hint = suggest(name, _KNOWN) or f"; allowed: {', '.join(_KNOWN)}"
            raise SettingsError(f"{cell.strip()!r} is not a column{hint}", str(path), line)
        columns.append((name, match[2] or ""))
    names = [name for name, _ in columns]
    groups = [("time",), *(tuple(g) for g in (_ANGLES, _QUATERNION) if set(g) & set(names))]
    missing = [name for group in groups for name in group if name not in names]
    if missing or len(set(names)) < len(names) or len(groups) > 2:
        what = f"lack {', '.join(missing)}" if missing else "name something twice, or two orientations"
        raise SettingsError(f"columns {what}", str(path), line)
    return columns


def _point(path: Path, line: int, row: list[str], columns: list[tuple[str, str]]) -> Point:
    if len(row) != len(columns):
        raise SettingsError(f"must have {len(columns)} values, got {len(row)}", str(path), line)
    values = dict.fromkeys(_KNOWN, 0.0)
    for (name, unit), cell in zip(columns, row, strict=True):
        values[name] = _value(path, line, name, f"{cell.strip()} {unit}")
    if any(name in _QUATERNION for name, _ in columns):
        orientation = np.array([values[name] for name in _QUATERNION])
    else:
        orientation = quaternion_from_rpy(*(values[name] for name in _ANGLES))
    return Point(values["time"], np.array([values[name] for name in "xyz"]), orientation, line)


def _value(path: Path, line: int, name: str, text: str) -> float:
    try:
        return parse(text, _KNOWN[name])
    except ValueError as error:
        raise SettingsError(str(error), str(path), line, key=name) from None
