"""What was refused at a socket: counted by peer and reason, in bounded memory, with a log line now and then."""

from __future__ import annotations

import logging

import zmq

_MOST = 100  # different (peer, reason) pairs that are kept apart: a stranger's invention must not fill the memory
_log = logging.getLogger("transport")


class Rejections:
    """Counts refusals at one place."""

    def __init__(self, where: str) -> None:
        self._where = where
        self._counts: dict[str, int] = {}

    @property
    def total(self) -> int:
        """All refusals."""
        return sum(self._counts.values())

    def add(self, peer: str, reason: str) -> None:
        """Count one; logs the 1st, 2nd, 4th, 8th ... of a kind, never a flood."""
        key = f"{peer}: {reason}"
        if key not in self._counts and len(self._counts) >= _MOST:
            key = "others"
        count = self._counts[key] = self._counts.get(key, 0) + 1
        if count & (count - 1) == 0:
            _log.warning("%s: refused a message from %s: %s (%d so far)", self._where, peer, reason, count)

    def as_dict(self) -> dict[str, int]:
        """``peer: reason`` -> count."""
        return dict(self._counts)


def peer_of(frame: zmq.Frame) -> str:
    """The address that a frame came from; libzmq knows none for Unix sockets, whose folder is ours alone."""
    try:
        return str(frame.get("Peer-Address")) or "this host"
    except (zmq.ZMQError, TypeError):
        return "this host"
