"""How a connection keeps samples, in RTT's words, and what became of each of them."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, NamedTuple

KINDS = ("data", "buffer", "circular_buffer", "reliable")
MAX_SIZE = 100_000  # [samples]


class FlowStatus(Enum):
    """What a read found: never anything, the same as last time, or something new."""

    NO_DATA = "NoData"
    OLD_DATA = "OldData"
    NEW_DATA = "NewData"


class WriteStatus(Enum):
    """What became of a write; only a ``reliable`` connection can fail."""

    SUCCESS = "WriteSuccess"
    FAILURE = "WriteFailure"
    NOT_CONNECTED = "NotConnected"


@dataclass(frozen=True)
class Policy:
    """A connection's policy.

    Attributes
    ----------
    kind : ``data`` keeps the latest; ``buffer`` keeps the oldest ``size`` and refuses new ones when full;
        ``circular_buffer`` keeps the newest ``size``; ``reliable`` tells the writer when ``size`` are waiting.
    size : number of samples, 1 for data.
    init : a late joiner is given the last sample written; RTT's default is True for data only.
    """

    kind: str = "data"
    size: int = 1
    init: bool = True

    @classmethod
    def of(cls, kind: str, size: int = 1, init: bool | None = None) -> Policy:
        """A policy with RTT's default for ``init``."""
        return cls(kind, size, kind == "data" if init is None else init)

    def __str__(self) -> str:
        return self.kind if self.kind == "data" else f"{self.kind} {self.size}"


@dataclass
class Account:
    """Where every sample of a connection went.

    Attributes
    ----------
    received : arrived at the reader's process, good ones only.
    replaced : overwritten by a newer one before they were read (data).
    dropped : did not fit the buffer.
    lost : gaps in the sender's sequence.
    restarts : how often the sender began anew.
    rejected : messages that broke the wire format, by reason.
    """

    received: int = 0
    replaced: int = 0
    dropped: int = 0
    lost: int = 0
    restarts: int = 0
    rejected: dict[str, int] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """Plain values for the wire and for JSON."""
        return {**self.__dict__, "rejected": dict(self.rejected)}


class Received(NamedTuple):
    """A sample as it waits to be read: data time [us], sequence, local arrival [s, monotonic]."""

    sample: Any
    time: int
    seq: int
    arrived: float


class Mailbox:
    """Where a connection keeps samples until the reader comes; safe between threads."""

    def __init__(self, policy: Policy) -> None:
        self.policy = policy
        self.account = Account()
        self._reliable = policy.kind == "reliable"
        self._lock = threading.Lock()
        self._waiting: deque[Received] = deque()
        self.on_room: Callable[[], None] = lambda: None

    def __len__(self) -> int:
        return len(self._waiting)

    @property
    def full(self) -> bool:
        """Whether a reliable connection must let the sender wait."""
        return self._reliable and len(self._waiting) >= self.policy.size

    def put(self, received: Received) -> bool:
        """Keep a sample as the policy says; False if it was refused."""
        with self._lock:
            self.account.received += 1
            if len(self._waiting) >= self.policy.size:
                if self.policy.kind == "data":
                    self.account.replaced += 1
                else:
                    self.account.dropped += 1
                if self.policy.kind in ("buffer", "reliable"):
                    return False
                self._waiting.popleft()
            self._waiting.append(received)
            return True

    def take(self) -> Received | None:
        """The oldest waiting sample, or None."""
        with self._lock:
            was_full = self.full
            received = self._waiting.popleft() if self._waiting else None
        if was_full:
            self.on_room()
        return received

    def peek(self) -> Received | None:
        """The newest waiting sample, left where it is."""
        with self._lock:
            return self._waiting[-1] if self._waiting else None

    def clear(self) -> None:
        """Forget what waits in a buffer; a data connection keeps its value, which still describes the world."""
        with self._lock:
            was_full = self.full
            if self.policy.kind != "data":
                self._waiting.clear()
        if was_full:
            self.on_room()  # what did not fit waits in the socket, and nothing else tells of it
