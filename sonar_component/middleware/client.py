"""Ports and tasks of a running graph, for other programs and notebooks.

    with connect("fls.sonar_samples") as port:
        for sonar in port:
            print(sonar.bins.shape)

Only the run directory is needed; for another host, `endpoint` says where the port is.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Generic, TypeVar, overload

from sonar_component.middleware.codec import decode, decode_untyped
from sonar_component.middleware.policy import KINDS, Account, Mailbox, Policy, Received
from sonar_component.middleware.ports import MAX_FRAME_BYTES, Connection
from sonar_component.middleware.rundir import find_task
from sonar_component.middleware.schema import schema_of
from sonar_component.middleware.transport.control import ControlClient
from sonar_component.middleware.transport.keys import joining
from sonar_component.middleware.transport.loop import Bell
from sonar_component.middleware.transport.transport import Join, Transport
from sonar_component.settings.errors import SettingsError, suggest

T = TypeVar("T")
_POLICIES = [kind for kind in KINDS if kind != "reliable"]  # that one the deployment has to open at the writer
_LOOK = 0.05  # [s], between two looks for a task that is not there yet
Decoder = Callable[[dict[str, Any], list[Any]], Any]


class PortReader(Generic[T]):
    """Reads one output port; made by `connect`.

    Attributes
    ----------
    name : ``task.port``.
    type_name : of the samples, on the wire.
    timeout : seconds that a read waits, None for ever.
    """

    def __init__(
        self, name: str, endpoint: str, type_name: str, decoder: Decoder, policy: Policy, timeout: float | None,
        join: Join | None = None,
    ) -> None:  # fmt: skip
        self.name, self.type_name, self.timeout = name, type_name, timeout
        self._transport = Transport()
        self._bell = Bell(self._transport.loop)
        self._connection = Connection(name, Mailbox(policy), on_arrival=self._bell.ring)
        connection, subscribe = self._connection, self._transport.subscribe
        self._subscriber = subscribe(endpoint, connection, decoder, "client", MAX_FRAME_BYTES, join)
        self._bell.attend(self._subscriber)

    @property
    def account(self) -> Account:
        """What was received, replaced, dropped and lost."""
        return self._connection.mailbox.account

    @property
    def bytes(self) -> int:
        """Bytes received."""
        return self._subscriber.bytes

    def read(self, timeout: float | None = None) -> T:
        """The next sample.

        Raises
        ------
        TimeoutError
            If none comes within `timeout` (or the reader's own) seconds.
        """
        sample: T = self.receive(timeout).sample
        return sample

    def receive(self, timeout: float | None = None) -> Received:
        """The next sample with its times and sequence number; raises as `read`."""
        timeout = self.timeout if timeout is None else timeout
        deadline = None if timeout is None else time.monotonic() + timeout
        while (received := self._connection.mailbox.take()) is None:
            left = None if deadline is None else deadline - time.monotonic()
            if left is not None and left <= 0:
                raise TimeoutError(f"no sample on {self.name} within {timeout:g} s")
            self._bell.wait(left)
        return received

    def __iter__(self) -> Iterator[T]:
        while True:
            yield self.read()

    def __enter__(self) -> PortReader[T]:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Stop reading."""
        self._transport.close()
        self._bell.close()


@overload
def connect(
    name: str, sample_type: type[T], *, policy: str | Policy = ..., size: int = ..., timeout: float | None = ...,
    instance: str | None = ..., endpoint: str | None = ..., decoder: Decoder | None = ...,
    keys: tuple[str, str | Path] | None = ...,
) -> PortReader[T]: ...  # fmt: skip
@overload
def connect(
    name: str, sample_type: None = ..., *, policy: str | Policy = ..., size: int = ..., timeout: float | None = ...,
    instance: str | None = ..., endpoint: str | None = ..., decoder: Decoder | None = ...,
    keys: tuple[str, str | Path] | None = ...,
) -> PortReader[Any]: ...  # fmt: skip


def connect(
    name: str,
    sample_type: type[Any] | None = None,
    *,
    policy: str | Policy = "data",
    size: int = 1,
    timeout: float | None = 5.0,
    instance: str | None = None,
    endpoint: str | None = None,
    decoder: Decoder | None = None,
    keys: tuple[str, str | Path] | None = None,
) -> PortReader[Any]:
    """Read an output port of a running task.

    Parameters
    ----------
    name : ``task.port`` or ``instance/task.port``.
    sample_type : the expected dataclass, for type checkers and as a check; found by its name otherwise.
    policy, size : ``data`` for the latest sample, ``buffer`` or ``circular_buffer`` with a size to see them all.
    timeout : seconds to wait for the task and for each sample; None for ever.
    endpoint : ZeroMQ address, where there is no run directory in common.
    keys : name of our own pair (``sonar keys new NAME``) and file of the server's public key, for an endpoint that
        another host guards.
    decoder : replaces the sample type; for tools that look at headers only.

    Raises
    ------
    SettingsError
        If there is no such port, or its type is another; names the nearest.
    """
    type_name = sample_type.__name__ if sample_type else ""
    if endpoint is None:
        record, port = _find_port(name, instance, timeout)
        name, endpoint = f"{record['task']}.{port['name']}", str(port["endpoint"])
        if type_name and type_name != port["type"]:
            raise SettingsError(f"{name} gives {port['type']}, not {type_name}")
        type_name = port["type"]
    cls = sample_type or known_type(type_name)
    if decoder is None:
        decoder = decode_untyped if cls is None else _typed(cls)
    if isinstance(policy, str):
        if policy not in _POLICIES:
            hint = suggest(policy, _POLICIES)
            raise SettingsError(f"policy must be one of {', '.join(_POLICIES)}, got {policy!r}{hint}")
        policy = Policy.of(policy, size, init=True)
    join = None if keys is None else joining(keys[0], Path(keys[1]))
    return PortReader(name, endpoint, type_name, decoder, policy, timeout, join)


def _typed(cls: type) -> Decoder:
    schema = schema_of(cls)
    return lambda header, buffers: decode(schema, header, buffers)


def _find_port(name: str, instance: str | None, timeout: float | None) -> tuple[dict[str, Any], dict[str, Any]]:
    task, dot, port = name.rpartition(".")
    if not dot:
        raise SettingsError(f"must be TASK.PORT, got {name!r}")
    record = wait_for_task(task, instance, timeout)
    outputs = {key: value for key, value in record["ports"].items() if value["direction"] == "out"}
    if port not in outputs:
        hint = "; it is an input" if port in record["ports"] else suggest(port, outputs)
        raise SettingsError(f"{task} has no output port {port!r}{hint}; it has: {', '.join(outputs)}")
    return record, {"name": port, **outputs[port]}


def wait_for_task(name: str, instance: str | None = None, timeout: float | None = 5.0) -> dict[str, Any]:
    """The record of a task; waits for one that is just starting, but not where nothing runs at all."""
    deadline = None if timeout is None else time.monotonic() + timeout
    while True:
        try:
            return find_task(name, instance)[1]
        except SettingsError:
            if deadline is not None and time.monotonic() >= deadline:
                raise
        time.sleep(_LOOK)


def known_type(name: str) -> type | None:
    """The sample type of that name, if it is installed here."""
    from sonar_component import samples
    from sonar_component.middleware.task import TaskState
    from sonar_component.samples import scene_description

    if name == TaskState.__name__:
        return TaskState
    for module in (samples, scene_description):
        found = getattr(module, name, None)
        if isinstance(found, type) and hasattr(found, "__dataclass_fields__"):
            return found
    return None


class TaskProxy:
    """Properties, operations and state of one running task; made by `connect_task`."""

    def __init__(self, record: dict[str, Any], timeout: float) -> None:
        self.name, self.record, self.timeout = str(record["task"]), record, timeout
        self._transport = Transport()
        self._client = ControlClient(self._transport.context, record["control"])

    def _ask(self, op: str, **arguments: Any) -> Any:
        return self._client.ask(op, self.timeout, task=self.name, **arguments)

    def state(self) -> dict[str, Any]:
        """State, sub-state and reason."""
        return dict(self._ask("state"))

    def describe(self) -> dict[str, Any]:
        """All there is to know: ports, connections with their accounts, properties, operations, counters."""
        return dict(self._ask("describe"))

    def get(self, name: str | None = None) -> Any:
        """A property's value, or all of them."""
        return self._ask("get", name=name)

    def set(self, name: str, value: Any) -> None:
        """Set a property; RuntimeError with the reason if it is refused."""
        self._ask("set", name=name, value=value)

    def call(self, operation: str, **arguments: Any) -> Any:
        """Call an operation; RuntimeError with the reason if it fails."""
        return self._ask("call", name=operation, arguments=arguments)

    def command(self, name: str) -> dict[str, Any]:
        """One of configure, start, stop, cleanup, recover; the state it came to."""
        return dict(self._ask("command", name=name))

    def __enter__(self) -> TaskProxy:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Leave."""
        self._client.close()
        self._transport.close()


def connect_task(name: str, *, timeout: float = 5.0, instance: str | None = None) -> TaskProxy:
    """Talk to a running task, ``task`` or ``instance/task``.

    Raises
    ------
    SettingsError
        If no such task runs; names the nearest.
    """
    return TaskProxy(wait_for_task(name, instance, timeout), timeout)
