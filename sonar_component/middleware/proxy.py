"""A running task, as another program asks it."""

from __future__ import annotations

from types import TracebackType
from typing import Any

from sonar_component.middleware.transport.control import ControlClient
from sonar_component.middleware.transport.transport import Join, Transport


class TaskProxy:
    """Properties, operations and state of one running task; made by `connect_task`.

    Attributes
    ----------
    name : of the task.
    record : what its process says of it: type, process, pid, ports.
    timeout : seconds that an answer may take.
    """

    def __init__(self, record: dict[str, Any], timeout: float, join: Join | None = None) -> None:
        self.name, self.record, self.timeout = str(record["task"]), record, timeout
        self._transport = Transport()
        self._client = ControlClient(self._transport.context, record["control"], join)

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
