"""Endpoints in processes of their own, as an integrator starts them."""

from __future__ import annotations

import json
import subprocess
import sys
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))  # wires.py, which tests import by name

# A wall across X with its face 4 m ahead, and a pillar of 0.4 m around a point 3 m to the right: bearings differ by
# 90 deg, ranges by 1.2 m.
SCENE = """
    version: 1
    bodies:
      wall: {box: {size: [1 m, 4 m, 6 m]}, pose: {position: [4.5 m, 0, 0]}}
      pillar: {cylinder: {radius: 0.2 m, length: 6 m}, pose: {position: [0, -3 m, 0]}}
"""
WALL, PILLAR = 4.0, 2.8  # [m], their distances


def same_echoes(got: np.ndarray, expected: np.ndarray, step: float) -> bool:
    """Whether an endpoint's echoes are those of `sonar ping`, both of full scale.

    Both choose their samples for the scene, the endpoint from those it had before: where a surface touches a bin with a
    sliver only, one may see it and the other not, which is let pass for 2 % of the lit bins. The others must agree
    within half a step of the device's integers and 0.02, the energy error that both aim for.
    """
    other = np.abs(got - expected) > step / 2 + 0.02
    return bool(np.count_nonzero(other) <= 0.02 * np.count_nonzero(expected))


class Emulated:
    """An endpoint and what it said.

    Attributes
    ----------
    places : addresses and names in the order in which it says them.
    """

    def __init__(self, *arguments: object) -> None:
        fine = ("--set", "accuracy=0.02", "--json")
        command = [sys.executable, "-m", "sonar_component", "emulate", *map(str, arguments), *fine]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        first = self.process.stdout.readline()
        assert first, self.process.stderr.read() if self.process.stderr else ""
        self.places = [place.split()[-1] for place in json.loads(first)["at"].split(", ")]

    def address(self, index: int = 0) -> tuple[str, int]:
        host, _, port = self.places[index].rpartition(":")
        return host, int(port)

    def memory(self) -> float:
        """Resident memory [MB]."""
        text = Path(f"/proc/{self.process.pid}/status").read_text()
        return next(float(line.split()[1]) / 1024 for line in text.splitlines() if line.startswith("VmRSS"))

    def end(self) -> dict[str, Any]:
        """Stop it; its account of its timing."""
        if self.process.poll() is None:
            self.process.terminate()
        out, _ = self.process.communicate(timeout=20)
        return dict(json.loads(out)["timing"]) if out else {}


@pytest.fixture(scope="session")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The scene file."""
    file = tmp_path_factory.mktemp("room") / "room.yaml"
    file.write_text(textwrap.dedent(SCENE))
    return file


@pytest.fixture(scope="module")
def emulate() -> Iterator[Callable[..., Emulated]]:
    """Start endpoints; they end with the module."""
    started: list[Emulated] = []

    def start(*arguments: object) -> Emulated:
        started.append(Emulated(*arguments))
        return started[-1]

    yield start
    for endpoint in started:
        endpoint.end()
