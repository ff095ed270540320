"""What running tasks cost, from two looks at what their processes tell."""

from __future__ import annotations

import time
from typing import Any

from sonar_component.middleware.reach import Reach
from sonar_component.middleware.survey import survey


class Load:
    """Remembers the last look; tasks that share a process each show all of it."""

    def __init__(self, reach: Reach | None = None) -> None:
        self._reach = reach or Reach()
        self._before = self._survey()

    def _survey(self) -> dict[tuple[str, str], tuple[float, float, dict[str, Any]]]:
        now = time.monotonic()
        tasks = survey(self._reach, "describe")
        return {(task["instance"], task["task"]): (now, _cost(task)["processor_time"], task) for task in tasks}

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
        "cpu": 100 * max(0.0, using - used) / elapsed,
        "memory_mb": _cost(task)["memory"] / 1e6,
        "lost": sum(connection["lost"] + connection["dropped"] for connection in connections),
    }


def _cost(task: dict[str, Any]) -> dict[str, float]:
    """Processor time [s] and memory [bytes] of a task's process; 0 where it does not answer."""
    nothing = {"processor_time": 0.0, "memory": 0.0}
    return dict(task.get("description", {}).get("costs", nothing))
