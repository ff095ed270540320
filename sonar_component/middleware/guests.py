"""Connections that clients asked for, beside those of the deployment: each is kept as long as its client lives.

Reading needs no asking: anybody may subscribe to an output port. What does need it is a reader that must not lose
anything, since the writer opens a socket of its own for it, and a writer, since somebody has to listen to it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from sonar_component.middleware.badge import client_endpoint, worn
from sonar_component.middleware.policy import KINDS, MAX_SIZE, Policy
from sonar_component.middleware.ports import Connection, InputPort
from sonar_component.middleware.rundir import Instance
from sonar_component.middleware.task import Task
from sonar_component.middleware.transport.subscriber import Subscriber
from sonar_component.middleware.transport.transport import Transport
from sonar_component.settings.errors import suggest

MOST = 64  # guests of one process
_LOOK = 1.0  # [s], between two looks for clients that are gone
_UNREAD = 5.0  # [s] for which the last samples of a client that has left wait to be read
Request = dict[str, Any]
Key = tuple[str, str]  # client, task.port


@dataclass
class _Writer:
    """A client that writes to one of our input ports; ``left`` is when it went, 0 while it is there."""

    port: InputPort[Any]
    connection: Connection
    subscriber: Subscriber
    left: float = 0.0
    last_seq: int = 0

    @property
    def all_read(self) -> bool:
        """Whether the task has read what the client wrote."""
        last = self.connection.last.seq if self.connection.last else 0
        return last >= self.last_seq and not len(self.connection.mailbox)


class Guests:
    """Answers the requests ``reserve``, ``admit`` and ``leave``; all in the loop's thread."""

    def __init__(self, transport: Transport, instance: Instance) -> None:
        self._transport, self._instance = transport, instance
        self._readers: dict[Key, str] = {}
        self._writers: dict[Key, _Writer] = {}
        transport.loop.every(_LOOK, self.look)

    def answers(self) -> dict[str, Callable[[Task, Request], Any]]:
        """Request -> what answers it."""
        return {"reserve": self._reserve, "admit": self._admit, "leave": self._leave}

    def _reserve(self, task: Task, request: Request) -> dict[str, str]:
        """Open a socket for a reliable reader; asked for again, it is the same one."""
        port = task.outputs.get(str(request.get("port")))
        if port is None:
            raise ValueError(_no_port(task, request, "output", task.outputs))
        key = (_client(request), port.full_name)
        if key not in self._readers:
            self._check_room()
            endpoint = self._instance.endpoint(f"{port.full_name}.{key[0]}")
            self._transport.bind_reliable(port, endpoint)
            self._readers[key] = endpoint
        return {"endpoint": self._readers[key]}

    def _admit(self, task: Task, request: Request) -> dict[str, Any]:
        """Listen to a client; asked for again, say what became of its samples."""
        port = task.inputs.get(str(request.get("port")))
        if port is None:
            raise ValueError(_no_port(task, request, "input", task.inputs))
        key = (_client(request), port.full_name)
        if key not in self._writers:
            self._check_room()
            self._check_type(port, request)
            self.look()
            self._check_alone(port, request)
            self._connect(key, port, policy_of(request))
        return self._writers[key].connection.mailbox.account.as_dict()

    def _leave(self, task: Task, request: Request) -> None:
        key = (_client(request), f"{task.name}.{request.get('port')}")
        writer = self._writers.get(key)
        if writer is not None:
            writer.left, writer.last_seq = time.monotonic(), int(request.get("seq") or 0)
        self._release(key)
        self.look()

    def _check_room(self) -> None:
        if len(self._readers) + len(self._writers) >= MOST:
            raise ValueError(f"this process has {MOST} guests already, which is the most")

    def _check_type(self, port: InputPort[Any], request: Request) -> None:
        ours, theirs = [port.schema.name, port.schema.major], [request.get("type"), request.get("major")]
        if ours != theirs:
            raise ValueError(f"{port.full_name} takes {ours[0]} version {ours[1]}, not {theirs[0]} version {theirs[1]}")

    def _check_alone(self, port: InputPort[Any], request: Request) -> None:
        gone = [writer.connection for writer in self._writers.values() if writer.left]
        others = [connection.source for connection in port.connections if connection not in gone]
        if others and not request.get("shared"):
            raise ValueError(
                f"{port.full_name} is connected to {', '.join(others)} already, and two writers would take turns; "
                "allowed: a port that nobody writes to, or sharing it (shared=True, --shared)"
            )

    def _connect(self, key: Key, port: InputPort[Any], policy: Policy) -> None:
        endpoint = client_endpoint(key[0])
        source = f"{key[0]}.{port.name}"
        subscriber = self._transport.connect(port, source, endpoint, policy)
        self._writers[key] = _Writer(port, port.connections[-1], subscriber)

    def look(self) -> None:
        """Part with clients that are gone."""
        now = time.monotonic()
        for key in [key for key in self._readers if not worn(key[0])]:
            self._release(key)
        for key, writer in list(self._writers.items()):
            if not writer.left and not worn(key[0]):
                writer.left = now
            if writer.left and (writer.all_read or now - writer.left > _UNREAD):
                del self._writers[key]
                writer.port.remove(writer.connection)
                self._transport.disconnect(writer.subscriber)

    def _release(self, key: Key) -> None:
        endpoint = self._readers.pop(key, None)
        if endpoint is not None:
            self._transport.release(key[1], endpoint)


def policy_of(request: Request) -> Policy:
    """The policy that a request asks for.

    Raises
    ------
    ValueError
        If there is none such.
    """
    kind, size = str(request.get("policy", "data")), request.get("size", 1)
    if kind not in KINDS:
        raise ValueError(f"policy must be one of {', '.join(KINDS)}, got {kind!r}{suggest(kind, KINDS)}")
    if type(size) is not int or not 1 <= size <= MAX_SIZE:
        raise ValueError(f"size of a {kind} must be 1 to {MAX_SIZE}, got {size!r}")
    return Policy(kind, 1 if kind == "data" else size, bool(request.get("init", True)))


def _client(request: Request) -> str:
    name = str(request.get("client"))
    client_endpoint(name)  # refuses what is no name
    if not worn(name):
        raise ValueError(f"no client {name[:60]!r} is there")
    return name


def _no_port(task: Task, request: Request, side: str, known: Any) -> str:
    name = str(request.get("port"))
    return f"{task.name} has no {side} port {name!r}{suggest(name, known)}; it has: {', '.join(known) or 'none'}"
