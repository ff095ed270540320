"""An input port of a running task, as another program writes it."""

from __future__ import annotations

import time
from types import TracebackType
from typing import Generic, TypeVar

from sonar_component.middleware.badge import client_endpoint
from sonar_component.middleware.policy import Account, Policy, WriteStatus
from sonar_component.middleware.ports import InvalidSampleError, OutputPort, invalid_reason
from sonar_component.middleware.transport.transport import Transport
from sonar_component.middleware.visit import Visit

T = TypeVar("T")
_LOOK = 0.002  # [s], between two looks whether the task listens


class PortWriter(Generic[T]):
    """Writes one input port; made by ``connect(..., write=True)``.

    Attributes
    ----------
    name : ``task.port``.
    sample_type : the dataclass that the port takes.
    policy : how samples wait for the task.
    """

    def __init__(
        self, name: str, sample_type: type[T], control: str, policy: Policy, timeout: float | None, shared: bool
    ) -> None:
        self.name, self.sample_type, self.policy = name, sample_type, policy
        task, _, port = name.rpartition(".")
        declared: OutputPort[T] = OutputPort(sample_type)
        self._transport = Transport()
        self._visit = Visit(
            self._transport, control, "admit", timeout, task=task, port=port, shared=shared, type=declared.schema.name,
            major=declared.schema.major, policy=policy.kind, size=policy.size, init=policy.init,
        )  # fmt: skip
        self._port = declared.own(self._visit.client, port)
        try:
            self._offer(client_endpoint(self._visit.client))
            self._visit.begin()
            self._wait_for_reader(timeout)
        except BaseException:
            self._transport.close()
            raise

    def _offer(self, endpoint: str) -> None:
        reliable = self.policy.kind == "reliable"
        self._transport.bind(self._port, [] if reliable else [endpoint])
        if reliable:
            self._transport.bind_reliable(self._port, endpoint)

    def _wait_for_reader(self, timeout: float | None) -> None:
        """What is written before the task has subscribed would be seen by nobody."""
        deadline = None if timeout is None else time.monotonic() + timeout
        while not self._port.connected():
            if deadline is not None and time.monotonic() > deadline:
                self._visit.end()
                raise TimeoutError(f"{self.name} does not listen within {timeout:g} s")
            time.sleep(_LOOK)

    @property
    def account(self) -> Account:
        """What became of the samples at the task: received, replaced, dropped, lost; half a second old at most."""
        return Account(**self._visit.answer)

    @property
    def written(self) -> int:
        """Samples written."""
        return self._port.seq

    @property
    def failures(self) -> int:
        """Samples that a ``reliable`` connection had no room for."""
        return self._port.failures

    def connected(self) -> bool:
        """Whether the task listens: it does not while its process starts again."""
        return self._port.connected()

    def write(self, sample: T) -> WriteStatus:
        """Give the task a sample; its arrays become read-only.

        Raises
        ------
        TypeError
            If the sample is not of the port's type.
        InvalidSampleError
            If its own ``validate()`` refuses it, such as a pose with NaN; nothing is sent.
        RuntimeError
            If the process has started again and refuses us since.
        """
        if self._visit.refused:
            raise RuntimeError(self._visit.refused)
        if not isinstance(sample, self.sample_type):
            raise TypeError(f"{self.name} takes {self.sample_type.__name__}, got {type(sample).__name__}")
        reason = invalid_reason(sample)
        if reason:
            raise InvalidSampleError(self.name, reason)
        return self._port.write(sample)

    def __enter__(self) -> PortWriter[T]:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<PortWriter {self.name} ({self.policy}): written {self.written}, failures {self.failures}>"

    def close(self) -> None:
        """Stop writing; the task may still read what was written last."""
        self._visit.end(self._port.seq)
        self._transport.close()
