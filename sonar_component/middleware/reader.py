"""An output port of a running task, as another program reads it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import Any, Generic, TypeVar

from sonar_component.middleware.policy import Account, Mailbox, Policy, Received
from sonar_component.middleware.ports import MAX_FRAME_BYTES, Connection
from sonar_component.middleware.schema import Schema
from sonar_component.middleware.transport.loop import Bell
from sonar_component.middleware.transport.transport import Join, Transport
from sonar_component.middleware.visit import Visit

T = TypeVar("T")
Decoder = Callable[[dict[str, Any], list[Any]], Any]


class PortReader(Generic[T]):
    """Reads one output port; made by `connect`.

    Attributes
    ----------
    name : ``task.port``.
    type_name : of the samples, on the wire.
    policy : how samples wait for us.
    timeout : seconds that a read waits, None for ever.
    """

    def __init__(
        self, name: str, endpoint: str, type_name: str, decoder: Decoder | Schema, policy: Policy,
        timeout: float | None, join: Join | None = None, control: str | None = None,
    ) -> None:  # fmt: skip
        self.name, self.type_name, self.policy, self.timeout = name, type_name, policy, timeout
        self._transport, self._visit = Transport(), None
        try:
            self._visit = self._reserve(control) if control is not None else None
        except BaseException:
            self._transport.close()
            raise
        self._bell = Bell(self._transport.loop)
        self._connection = Connection(name, Mailbox(policy), on_arrival=self._bell.ring)
        at = endpoint if self._visit is None else str(self._visit.answer["endpoint"])
        subscribe = self._transport.subscribe
        self._subscriber = subscribe(at, self._connection, decoder, "client", MAX_FRAME_BYTES, join)
        self._bell.attend(self._subscriber)

    def _reserve(self, control: str) -> Visit:
        """Ask the writer for a socket of our own, on which nothing is dropped."""
        task, _, port = self.name.rpartition(".")
        visit = Visit(self._transport, control, "reserve", self.timeout, task=task, port=port)
        visit.begin()
        return visit

    @property
    def account(self) -> Account:
        """What was received, replaced, dropped, lost and refused."""
        return self._connection.mailbox.account

    @property
    def waiting(self) -> int:
        """Samples that wait to be read."""
        return len(self._connection.mailbox)

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
                raise TimeoutError(f"no sample on {self.name} within {timeout:g} s{self._why()}")
            self._bell.wait(left)
        return received

    def _why(self) -> str:
        if self._visit is not None and self._visit.refused:
            return f": {self._visit.refused}"
        rejected = self.account.rejected
        if rejected:
            return f": refused {sum(rejected.values())} messages, {next(iter(rejected))}"
        return f"; {self.account.lost} were lost before" if self.account.lost else ""

    def __iter__(self) -> Iterator[T]:
        while True:
            yield self.read()

    def __enter__(self) -> PortReader[T]:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def __repr__(self) -> str:
        account = self.account
        counts = f"received {account.received}, replaced {account.replaced}, dropped {account.dropped}"
        return f"<PortReader {self.name} ({self.policy}): {counts}, lost {account.lost}>"

    def close(self) -> None:
        """Stop reading."""
        if self._visit is not None:
            self._visit.end()
        self._transport.close()
        self._bell.close()
