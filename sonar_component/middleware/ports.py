"""Typed ports: what a task reads and writes, whatever carries it.

A class declares its ports as attributes; every task gets its own copies. Within a process a sample is handed over as it
is, so writing makes its arrays read-only: an array belongs to the graph once it is written.
"""

from __future__ import annotations

import copy
import dataclasses
import threading
import time
from collections.abc import Callable
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from sonar_component.middleware.policy import FlowStatus, Mailbox, Policy, Received, WriteStatus
from sonar_component.middleware.schema import Schema, schema_of

T = TypeVar("T")
PortT = TypeVar("PortT", bound="_Port")
MAX_FRAME_BYTES = 64 << 20  # default limit of one array on the wire


class InvalidSampleError(ValueError):
    """A sample that arrived whole but cannot be used, such as a pose with NaN."""

    def __init__(self, port: str, reason: str) -> None:
        self.port, self.reason = port, reason
        super().__init__(f"{port}: {reason}")


class Carrier(Protocol):
    """What takes a port's samples out of the process."""

    def publish(self, sample: Any, time: int, seq: int) -> bool:
        """Send; False if a reliable reader could not take it."""

    def listeners(self) -> int:
        """How many readers are there now."""


class _Port:
    """What both directions share: type, name and owner."""

    def __init__(self, sample_type: type, *, doc: str, max_bytes: int):
        self.sample_type, self.doc, self.max_bytes = sample_type, doc, max_bytes
        self.name = self.owner = ""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    @property
    def schema(self) -> Schema:
        """The sample type on the wire."""
        return schema_of(self.sample_type)

    @property
    def full_name(self) -> str:
        """``task.port``."""
        return f"{self.owner}.{self.name}"

    def own(self: PortT, owner: str, name: str | None = None) -> PortT:
        """A fresh copy for one task."""
        port = copy.copy(self)
        port.owner, port.name = owner, name or self.name
        port._reset()
        return port

    def _reset(self) -> None:
        raise NotImplementedError


@dataclasses.dataclass(eq=False)
class Connection:
    """One line of the graph as the reader holds it.

    Attributes
    ----------
    source : ``task.port`` of the writer.
    mailbox : what waits to be read, and the account of what did not.
    max_age : seconds after which the last sample is too old to go on with; None for never.
    """

    source: str
    mailbox: Mailbox
    max_age: float | None = None
    on_arrival: Callable[[], None] = lambda: None
    made: float = dataclasses.field(default_factory=time.monotonic)
    last: Received | None = None

    def deliver(self, received: Received) -> None:
        """Put a sample into the mailbox and wake the reader."""
        self.last = received
        if self.mailbox.put(received):
            self.on_arrival()


class InputPort(_Port, Generic[T]):
    """A port that a task reads.

    Parameters
    ----------
    sample_type : dataclass that arrives.
    required : ``check`` refuses a deployment that leaves it unconnected.
    automatic : where a deployment leaves it unconnected and one port alone gives that type, it is connected to that
        one: for what there is one of, such as the world.
    """

    def __init__(
        self,
        sample_type: type[T],
        *,
        doc: str = "",
        required: bool = False,
        automatic: bool = False,
        max_bytes: int = MAX_FRAME_BYTES,
    ) -> None:
        super().__init__(sample_type, doc=doc, max_bytes=max_bytes)
        self.required, self.automatic = required, automatic

    def _reset(self) -> None:
        self.connections: list[Connection] = []
        self._next = 0
        self.invalid = 0
        self.last: Received | None = None
        self.on_arrival: Callable[[], None] = lambda: None

    def add(self, connection: Connection) -> None:
        """Read from one more connection."""
        connection.on_arrival = lambda: self.on_arrival()
        self.connections = [*self.connections, connection]

    def remove(self, connection: Connection) -> None:
        """Read no more from a connection; the list is replaced, since the task may be walking along the old one."""
        self.connections = [other for other in self.connections if other is not connection]

    def connected(self) -> bool:
        """Whether anything is connected."""
        return bool(self.connections)

    def read(self) -> tuple[FlowStatus, T | None]:
        """Take the next sample; the last one again, as OldData, where nothing new came.

        Raises
        ------
        InvalidSampleError
            If the next sample's own ``validate()`` refuses it; it is dropped and counted.
        """
        received = self._take()
        if received is None:
            return (FlowStatus.OLD_DATA, self.last.sample) if self.last else (FlowStatus.NO_DATA, None)
        reason = invalid_reason(received.sample)
        if reason:
            self.invalid += 1
            raise InvalidSampleError(self.full_name, reason)
        self.last = received
        return FlowStatus.NEW_DATA, received.sample

    def read_new(self) -> T | None:
        """The next sample if there is a new one."""
        status, sample = self.read()
        return sample if status is FlowStatus.NEW_DATA else None

    def latest(self) -> T | None:
        """The newest sample, new or not, or None; older ones that wait are passed over."""
        sample = self.read()[1]
        while self.pending():
            sample = self.read()[1]
        return sample

    def pending(self) -> int:
        """How many samples wait to be read."""
        return sum(len(connection.mailbox) for connection in self.connections)

    def peek_valid(self) -> bool:
        """Whether a usable new sample waits."""
        newest = [connection.mailbox.peek() for connection in self.connections]
        return any(r is not None and not invalid_reason(r.sample) for r in newest)

    def drop_invalid(self) -> None:
        """Pass over unusable samples up to the next good one."""
        for connection in self.connections:
            while (received := connection.mailbox.peek()) is not None and invalid_reason(received.sample):
                connection.mailbox.take()
                self.invalid += 1

    def stale(self, now: int) -> str:
        """Why a connection is too old to go on with at data time `now` [us], or the empty string."""
        for connection in self.connections:
            if connection.max_age is None:
                continue
            last = connection.last
            age = time.monotonic() - (last.arrived if last else connection.made)
            if last and last.time:
                age = max(age, (now - last.time) * 1e-6)
            if age > connection.max_age:
                allowed = f"allowed {connection.max_age:g} s"
                return f"{self.full_name}: no sample from {connection.source} for {age:.2f} s, {allowed}"
        return ""

    def clear(self) -> None:
        """Start afresh, as Rock does when a task starts: buffers are emptied; a data connection keeps its value."""
        for connection in self.connections:
            connection.mailbox.clear()

    def _take(self) -> Received | None:
        connections = self.connections
        count = len(connections)
        for index in range(self._next, self._next + count):
            received = connections[index % count].mailbox.take()
            if received is not None:
                self._next = (index + 1) % count  # the next read begins with another writer
                return received
        return None


class OutputPort(_Port, Generic[T]):
    """A port that a task writes.

    Parameters
    ----------
    sample_type : dataclass that leaves.
    queue : samples that may wait for one reader's process before the newest is dropped for it.
    """

    def __init__(
        self, sample_type: type[T], *, queue: int = 64, doc: str = "", max_bytes: int = MAX_FRAME_BYTES
    ) -> None:
        super().__init__(sample_type, doc=doc, max_bytes=max_bytes)
        self.queue = queue

    def _reset(self) -> None:
        self.local: list[Connection] = []
        self.carrier: Carrier | None = None
        self.seq = self.failures = 0
        self.last: Received | None = None
        self.clock: Callable[[], int] = lambda: time.time_ns() // 1000
        self._lock = threading.Lock()

    def connected(self) -> bool:
        """Whether anyone listens now: ask before costly work."""
        return bool(self.local) or (self.carrier is not None and self.carrier.listeners() > 0)

    def listeners(self) -> int:
        """How many connections read this port now."""
        return len(self.local) + (self.carrier.listeners() if self.carrier else 0)

    def write(self, sample: T) -> WriteStatus:
        """Give a sample to all readers; its arrays become read-only.

        Raises
        ------
        TypeError
            If the sample is not of the port's type.
        """
        if not isinstance(sample, self.sample_type):
            raise TypeError(f"{self.full_name} takes {self.sample_type.__name__}, got {type(sample).__name__}")
        with self._lock:
            self.seq += 1
            received = Received(sample, int(getattr(sample, "time", 0)), self.seq, time.monotonic())
            self.last = received
            delivered = self.carrier.publish(sample, received.time, self.seq) if self.carrier else True
            freeze(sample)  # after what is far away, which it would only delay: nobody here has the sample yet
            for connection in self.local:
                delivered &= not connection.mailbox.full
                connection.deliver(received)
        if not delivered:
            self.failures += 1
            return WriteStatus.FAILURE
        return WriteStatus.SUCCESS if self.connected() else WriteStatus.NOT_CONNECTED

    def hand_over(self, connection: Connection) -> None:
        """Connect a reader in the same process: samples are passed on without packing."""
        with self._lock:
            self.local.append(connection)
            if connection.mailbox.policy.init and self.last is not None:
                connection.deliver(self.last)


def freeze(sample: Any) -> None:
    """Make the arrays of a dataclass read-only."""
    for value in sample.__dict__.values():
        if type(value) is np.ndarray:
            value.setflags(write=False)


def invalid_reason(sample: Any) -> str:
    """What the sample's own ``validate()`` says against it, or the empty string."""
    validate = getattr(sample, "validate", None)
    if validate is None:
        return ""
    try:
        validate()
    except (ValueError, TypeError, AttributeError) as error:
        return str(error)
    return ""


def connect_in_process(
    writer: OutputPort[T], reader: InputPort[T], policy: Policy, max_age: float | None = None
) -> Connection:
    """Join two ports of one process."""
    connection = Connection(writer.full_name, Mailbox(policy), max_age)
    reader.add(connection)
    writer.hand_over(connection)
    return connection
