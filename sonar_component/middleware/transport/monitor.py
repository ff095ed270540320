"""What libzmq says about a socket's connections: who was cut off, and whose handshake failed.

A peer that sends a frame above the limit is cut off and, in libzmq 4.3.5, *not* connected again; so is noise on a TCP
port. Neither is seen in the messages, so both are taken from here.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import zmq
from zmq.utils.monitor import parse_monitor_message

from sonar_component.middleware.transport.sockets import Socket

_WHY = {
    int(zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL): "handshake failed",
    int(zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL): "handshake failed: not the protocol or security of this port",
    int(zmq.EVENT_HANDSHAKE_FAILED_AUTH): "handshake failed: key is not on the allow-list",
}
FAILED = sum(_WHY)


class Monitor:
    """Tells of disconnections or failed handshakes of one socket.

    Parameters
    ----------
    socket : to be watched.
    events : `FAILED`, or ``zmq.EVENT_DISCONNECTED``.
    tell : called with the peer's address and the reason, in the loop's thread.
    """

    def __init__(self, socket: Socket, events: int, tell: Callable[[str, str], None]) -> None:
        self._socket, self._tell = socket.get_monitor_socket(events), tell
        self._watched, self._lock = socket, threading.Lock()
        self.fd = int(self._socket.getsockopt(zmq.FD))

    def serve(self) -> None:
        """Take events."""
        while (event := self._next()) is not None:
            self._tell(event["endpoint"].decode(errors="replace"), _WHY.get(int(event["event"]), "disconnected"))

    def _next(self) -> Any:
        with self._lock:
            if self._socket.closed:
                return None
            try:
                return parse_monitor_message(self._socket.recv_multipart(zmq.NOBLOCK))
            except zmq.Again:
                return None

    def close(self) -> None:
        """Stop watching; before the watched socket is closed."""
        with self._lock:
            if not self._socket.closed:
                self._watched.disable_monitor()
                self._socket.close()
