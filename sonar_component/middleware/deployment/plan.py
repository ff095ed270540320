"""What a checked deployment comes to: plain data, so that it can be handed to processes and looked at as JSON."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class TaskPlan:
    """One task with everything resolved; ``activity`` is kind -> value, as in the file."""

    name: str
    type: str
    process: str
    properties: dict[str, Any]
    activity: dict[str, Any]
    host: str = ""


@dataclass(frozen=True)
class ConnectionPlan:
    """One line of the graph."""

    source: str
    target: str
    policy: str = "data"
    size: int = 1
    init: bool = True
    max_age: float | None = None


@dataclass(frozen=True)
class RestartPlan:
    """When and how often a process is started again; times in seconds."""

    restart: str = "on_failure"
    max_restarts: int = 5
    restart_window: float = 60.0
    restart_delay: float = 0.1
    hang_timeout: float = 10.0
    critical: bool = False


@dataclass(frozen=True)
class Plan:
    """A checked deployment; ``insecure`` where others can reach it without keys.

    Attributes
    ----------
    name : of the instance.
    file : the deployment file, beside which files are looked for.
    clock : mode, rate, lockstep, step [s], start [s].
    restart : process -> its rules.
    addresses : ``task.port`` -> tcp address, for ports read from another host.
    controls : ``host/process`` -> tcp address at which another host may ask that process.
    """

    name: str
    file: str
    tasks: list[TaskPlan]
    connections: list[ConnectionPlan]
    clock: dict[str, Any] = field(default_factory=lambda: {"mode": "wall", "rate": 1.0, "lockstep": False})
    restart: dict[str, RestartPlan] = field(default_factory=dict)
    addresses: dict[str, str] = field(default_factory=dict)
    controls: dict[str, str] = field(default_factory=dict)
    hosts: dict[str, dict[str, Any]] = field(default_factory=dict)
    insecure: bool = False

    def processes(self, host: str = "") -> dict[str, list[TaskPlan]]:
        """Process -> its tasks, in the order of the file."""
        found: dict[str, list[TaskPlan]] = {}
        for task in self.tasks:
            if task.host == host:
                found.setdefault(task.process, []).append(task)
        return found

    def task(self, name: str) -> TaskPlan:
        """The task of that name."""
        return next(task for task in self.tasks if task.name == name)

    def to_json(self) -> str:
        """The plan as text."""
        return json.dumps(dataclasses.asdict(self))

    @classmethod
    def from_json(cls, text: str) -> Plan:
        """Read it again."""
        data = json.loads(text)
        data["tasks"] = [TaskPlan(**task) for task in data["tasks"]]
        data["connections"] = [ConnectionPlan(**connection) for connection in data["connections"]]
        data["restart"] = {name: RestartPlan(**rules) for name, rules in data["restart"].items()}
        return cls(**data)
