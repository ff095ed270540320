"""The graph that the viewer belongs to: what the page says about each task, and how it sets their properties."""

from __future__ import annotations

from typing import Any

from sonar_component.middleware.task import Task


class Graph:
    """All tasks of the instance that a task runs in."""

    def __init__(self, own: Task) -> None:
        self._own = own

    def status(self) -> list[dict[str, Any]]:
        """State of each task, as the page shows it."""
        life = self._own.lifecycle
        return [
            {
                "name": self._own.name,
                "type": type(self._own).__name__,
                "state": life.state.value,
                "substate": life.substate,
                "reason": life.reason,
                "properties": [],
            }
        ]

    def set(self, task: str, name: str, value: Any) -> Any:
        """Set a property of a task; ValueError with the reason if it is refused."""
        raise ValueError(f"{task} cannot be reached from here")
