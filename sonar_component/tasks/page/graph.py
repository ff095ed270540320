"""The graph that the viewer belongs to: what the page says about each task, and how it sets their properties."""

from __future__ import annotations

import json
import os
import threading
from typing import Any

from sonar_component.middleware.introspection import properties_of, state_of
from sonar_component.middleware.proxy import TaskProxy
from sonar_component.middleware.rundir import Instance, instances
from sonar_component.middleware.task import Task

_PATIENCE = 1.0  # [s], for a task to answer: longer than any frame, and the page must not wait for one that hangs
GONE = "GONE"  # not a state of the life cycle: the process has ended


class Graph:
    """All tasks of the instance that a task runs in.

    Safe between threads. A task that was seen and whose process has ended stays in the list and is said to be gone.
    """

    def __init__(self, own: Task) -> None:
        self._own = own
        self._instance: Instance | None = None
        self._proxies: dict[str, TaskProxy] = {}
        self._seen: dict[str, dict[str, Any]] = {}
        self._pids: dict[str, int] = {}
        self._restarts: dict[str, int] = {}
        self._lock = threading.Lock()  # a proxy has one socket, for one question at a time

    def status(self) -> list[dict[str, Any]]:
        """Every task: name, type, state, substate, reason, properties."""
        with self._lock:
            records = self._records()
            for name, record in records.items():
                self._seen[name] = self._with_restarts(self._ask(name, record), record["pid"])
            for name in self._seen.keys() - records.keys() - {self._own.name}:
                self._drop(name)
                ended = {"state": GONE, "substate": "", "reason": "its process has ended", "properties": []}
                self._seen[name] = {**self._seen[name], **ended}
            if self._own.name not in records:
                self._seen[self._own.name] = self._describe_own()
            return [self._seen[name] for name in sorted(self._seen)]

    def set(self, task: str, name: str, value: Any) -> Any:
        """Set a property and return what it is now.

        Raises
        ------
        ValueError
            If the task is not there or refuses; the text is its reason.
        TimeoutError
            If it does not answer in time; it may set it yet.
        """
        with self._lock:
            record = self._records().get(task)
            if record is None:
                raise ValueError(f"{task} is not running")
            proxy = self._proxy(task, record)
            try:
                proxy.set(name, value)
                return _written(proxy.get()[name])
            except RuntimeError as error:
                raise ValueError(str(error)) from None

    def close(self) -> None:
        """Close all connections to tasks."""
        with self._lock:
            for name in list(self._proxies):
                self._drop(name)

    def _records(self) -> dict[str, dict[str, Any]]:
        if self._instance is None:
            # A task does not know its instance: it is the one where its name stands with this process's id.
            self._instance = next((i for i in instances() if self._is_mine(i)), None)
        return self._instance.records() if self._instance is not None else {}

    def _is_mine(self, instance: Instance) -> bool:
        return bool(instance.records().get(self._own.name, {}).get("pid") == os.getpid())

    def _ask(self, name: str, record: dict[str, Any]) -> dict[str, Any]:
        try:
            told = self._proxy(name, record).describe()
        except (RuntimeError, TimeoutError) as error:
            silent = {"state": "NO_ANSWER", "substate": "", "reason": str(error), "properties": []}
            return {"name": name, "type": record["type"], **silent}
        return _entry(name, told["type"], told, told["properties"])

    def _with_restarts(self, entry: dict[str, Any], pid: int) -> dict[str, Any]:
        """Say how often a task's process was another one: a task that dies and comes back must not look well."""
        name = entry["name"]
        if self._pids.setdefault(name, pid) != pid:
            self._pids[name], self._restarts[name] = pid, self._restarts.get(name, 0) + 1
        times = self._restarts.get(name, 0)
        return {**entry, "restarts": times}

    def _describe_own(self) -> dict[str, Any]:
        own = self._own
        return _entry(own.name, type(own).__name__, state_of(own), properties_of(own))

    def _proxy(self, name: str, record: dict[str, Any]) -> TaskProxy:
        known = self._proxies.get(name)
        if known is None or known.record["pid"] != record["pid"]:
            self._drop(name)
            self._proxies[name] = TaskProxy(record, _PATIENCE)
        return self._proxies[name]

    def _drop(self, name: str) -> None:
        if name in self._proxies:
            self._proxies.pop(name).close()


def _entry(name: str, kind: str, state: dict[str, Any], properties: dict[str, dict[str, Any]]) -> dict[str, Any]:
    listed = [
        {"name": key, "value": _written(p), "settable": p["settable"], "description": p["doc"]}
        for key, p in properties.items()
    ]
    told = {key: state[key] for key in ("state", "substate", "reason")}
    return {"name": name, "type": kind, **told, "properties": listed}


def _written(told: dict[str, Any]) -> Any:
    """A property's value with the unit that people use; NaN and infinities, which JSON cannot hold, as text."""
    value = told.get("written", told["value"])
    try:
        json.dumps(value, allow_nan=False)
    except (ValueError, TypeError):
        return str(value)
    return value
