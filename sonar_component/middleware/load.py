"""What running tasks cost, from two looks at their counters and at /proc."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any

from sonar_component.middleware.reach import Reach
from sonar_component.middleware.survey import survey

_TICK = os.sysconf("SC_CLK_TCK")  # [1/s]
_PAGE = os.sysconf("SC_PAGE_SIZE")  # [bytes]


class Load:
    """Remembers the last look; tasks that share a process show its processor and memory each, other hosts' show 0."""

    def __init__(self, reach: Reach | None = None) -> None:
        self._reach = reach or Reach()
        self._before = self._survey()

    def _survey(self) -> dict[tuple[str, str], tuple[float, float, dict[str, Any]]]:
        now = time.monotonic()
        tasks = survey(self._reach, "describe")
        return {(task["instance"], task["task"]): (now, _used(task), task) for task in tasks}

    def look(self) -> list[dict[str, Any]]:
        """One row for each task."""
        after = self._survey()
        rows = [_row(self._before.get(key, value), value) for key, value in after.items()]
        self._before = after
        return rows


def _row(before: tuple[float, float, dict[str, Any]], after: tuple[float, float, dict[str, Any]]) -> dict[str, Any]:
    (then, used, earlier), (now, using, task) = before, after
    elapsed = now - then or float("inf")
    counters = task.get("description", {}).get("counters", {})
    old = earlier.get("description", {}).get("counters", {})
    inputs = task.get("description", {}).get("inputs", {}).values()
    connections = [connection for port in inputs for connection in port["connections"]]
    return {
        "instance": task["instance"],
        "host": task["host"],
        "task": task["task"],
        "state": task["state"],
        "reason": task["reason"],
        "rate": (counters.get("cycles", 0) - old.get("cycles", 0)) / elapsed,
        "overruns": counters.get("overruns", 0),
        "longest_ms": counters.get("longest", 0.0) * 1e3,
        "cpu": 100 * (using - used) / elapsed,
        "memory_mb": 0.0 if task["host"] else resident(task["pid"]) / 1e6,
        "lost": sum(connection["lost"] + connection["dropped"] for connection in connections),
    }


def _used(task: dict[str, Any]) -> float:
    """Processor time [s]; 0 for a task of another host, whose /proc is not ours."""
    return 0.0 if task["host"] else processor_time(task["pid"])


def processor_time(pid: int) -> float:
    """User and system time of a process [s]; 0 if it is gone."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / _TICK


def resident(pid: int) -> int:
    """Memory of a process [bytes]; 0 if it is gone."""
    try:
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * _PAGE
    except OSError:
        return 0
