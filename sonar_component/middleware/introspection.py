"""What a process tells about its tasks, and what may be asked of them."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from sonar_component.middleware.guests import Guests
from sonar_component.middleware.lifecycle import Command, State
from sonar_component.middleware.lockstep import Stepper
from sonar_component.middleware.operations import call, operations_of
from sonar_component.middleware.proc import resident
from sonar_component.middleware.runner import Runner
from sonar_component.middleware.task import Task
from sonar_component.middleware.transport.control import ControlServer
from sonar_component.middleware.transport.transport import Transport
from sonar_component.settings.errors import suggest
from sonar_component.settings.meaning import meaning
from sonar_component.settings.written import written

Request = dict[str, Any]


class Introspection:
    """Answers the requests of `ControlServer`; what touches a task runs in the task's thread.

    Attributes
    ----------
    records : task -> what the run directory says of it, for clients of other hosts.
    servers : of this process, whose refusals are shown.
    """

    def __init__(
        self,
        tasks: dict[str, Task],
        runners: dict[str, Runner],
        transport: Transport,
        stepper: Stepper | None = None,
        guests: Guests | None = None,
    ) -> None:
        self._tasks, self._runners, self._transport = tasks, runners, transport
        self.records: dict[str, dict[str, Any]] = {}
        self.servers: list[ControlServer] = []
        self._answers: dict[str, Callable[[Task, Request], Any]] = {
            "record": lambda task, request: self.records[task.name],
            "state": lambda task, request: state_of(task),
            "describe": lambda task, request: self._describe(task),
            "get": self._get,
            "set": self._set,
            "call": self._call,
            "command": self._command,
        }
        if guests is not None:
            self._answers |= guests.answers()
        if stepper is not None:
            self._answers["step"] = lambda task, request: stepper.step(request)

    def answer(self, request: Request) -> Any:
        """The result of a request, or a Future of it; raises ValueError for what is not there."""
        op, name = request["op"], request.get("task")
        if op == "tasks":
            return list(self._tasks)
        if op not in self._answers:
            raise ValueError(f"no such request {op!r}{suggest(op, self._answers)}")
        if name not in self._tasks:
            raise ValueError(f"no task {name!r} in this process")
        return self._answers[op](self._tasks[name], request)

    def _describe(self, task: Task) -> dict[str, Any]:
        return {
            **state_of(task),
            "type": type(task).__name__,
            "counters": dict(vars(task.counters)),
            "costs": {"processor_time": time.process_time(), "memory": resident(os.getpid())},
            "properties": properties_of(task),
            "operations": operations_of(type(task)),
            "inputs": {name: self._input(port) for name, port in task.inputs.items()},
            "outputs": {name: self._output(port) for name, port in task.outputs.items()},
            "refused_requests": {k: v for server in self.servers for k, v in server.rejected.as_dict().items()},
        }

    def _input(self, port: Any) -> dict[str, Any]:
        connections = [
            {
                "from": c.source,
                "policy": str(c.mailbox.policy),
                "waiting": len(c.mailbox),
                **c.mailbox.account.as_dict(),
            }
            for c in port.connections
        ]
        return {"type": port.schema.name, "doc": port.doc, "invalid": port.invalid, "connections": connections}

    def _output(self, port: Any) -> dict[str, Any]:
        publisher = self._transport.publishers.get(port.full_name)
        return {
            "type": port.schema.name, "doc": port.doc, "written": port.seq, "failures": port.failures,
            "listeners": port.listeners(), "bytes": publisher.sent_bytes if publisher else 0,
            "rejected": publisher.rejected.as_dict() if publisher else {},
        }  # fmt: skip

    def _get(self, task: Task, request: Request) -> Any:
        values = properties_of(task)
        name = request.get("name")
        if name is None:
            return values
        if name not in values:
            raise ValueError(f"{task.name} has no property {name!r}{suggest(str(name), values)}")
        return values[name]["value"]

    def _set(self, task: Task, request: Request) -> Future[Any]:
        name, value = str(request.get("name")), request.get("value")
        return self._runners[task.name].call(lambda: task.set_property(name, value))

    def _call(self, task: Task, request: Request) -> Future[Any]:
        arguments = dict(request.get("arguments") or {})
        return self._runners[task.name].call(lambda: call(task, str(request.get("name")), arguments))

    def _command(self, task: Task, request: Request) -> Future[Any]:
        commands: dict[str, Callable[[], Any]] = {
            "configure": task.configure, "start": task.start, "stop": task.stop, "cleanup": task.cleanup,
            "recover": lambda: task.lifecycle.do(Command.RECOVER),
        }  # fmt: skip
        name = str(request.get("name"))
        if name not in commands:
            raise ValueError(f"no such command {name!r}{suggest(name, commands)}; allowed: {', '.join(commands)}")

        def run() -> dict[str, Any]:
            done = commands[name]()
            return {"done": bool(done), **state_of(task)}

        return self._runners[task.name].call(run)


def state_of(task: Task) -> dict[str, Any]:
    """State, sub-state and reason of a task."""
    lifecycle = task.lifecycle
    return {
        "task": task.name, "state": lifecycle.state.value, "target": lifecycle.target.value,
        "substate": lifecycle.substate, "reason": lifecycle.reason,
    }  # fmt: skip


def properties_of(task: Task) -> dict[str, dict[str, Any]]:
    """Name -> value, the same as people write it, whether it is dynamic, and what it means."""
    values = task.properties.model_dump(mode="json") if task.properties is not None else task.given
    editable = task.lifecycle.state is State.PRE_OPERATIONAL
    return {
        name: {
            "value": values.get(name),
            "written": written(type(task).Properties, name, values.get(name)),
            "dynamic": name in task.dynamic,
            "settable": editable or name in task.dynamic,
            "doc": meaning(type(task).Properties, name),
        }
        for name in type(task).Properties.model_fields
    }
