"""ZeroMQ sockets as this project opens them: every limit in one place.

Measured with libzmq 4.3.5: without MAXMSGSIZE a 10 MB topic costs a publisher 388 MB; a subscriber that asks for a
topic of 200 kB crashes at close; and LINGER is endless by default, so a dead peer would keep a process from ending.
"""

from __future__ import annotations

from typing import Any

import zmq

from sonar_component.middleware.codec import MAX_HEADER_BYTES
from sonar_component.settings.errors import SettingsError

LINGER_MS = 200
HEARTBEAT_MS, HEARTBEAT_TIMEOUT_MS = 1000, 3000
RECONNECT_MS, RECONNECT_MAX_MS = 20, 500
MAX_SUBSCRIPTION_BYTES = 200  # libzmq keeps what a peer subscribes to: about 75 bytes for each byte, until it leaves
MAX_HANDSHAKE_BYTES = 1024  # the limit holds for CURVE's own frames too, of which INITIATE has 257 bytes and more
MAX_REQUEST_BYTES = 1 << 20
HANDSHAKE_MS = 5000
_POLLIN = int(zmq.POLLIN)  # zmq's own kind of number takes longer than the question

Socket = zmq.Socket[bytes]


def open_socket(context: zmq.Context[Any], kind: int, max_bytes: int) -> Socket:
    """A socket with this project's limits."""
    socket: Socket = context.socket(kind)
    socket.linger = LINGER_MS
    socket.setsockopt(zmq.MAXMSGSIZE, max_bytes)
    socket.setsockopt(zmq.HEARTBEAT_IVL, HEARTBEAT_MS)
    socket.setsockopt(zmq.HEARTBEAT_TIMEOUT, HEARTBEAT_TIMEOUT_MS)
    socket.setsockopt(zmq.HANDSHAKE_IVL, HANDSHAKE_MS)
    socket.setsockopt(zmq.RECONNECT_IVL, RECONNECT_MS)
    socket.setsockopt(zmq.RECONNECT_IVL_MAX, RECONNECT_MAX_MS)
    return socket


def bind(socket: Socket, endpoint: str) -> None:
    """Bind.

    Raises
    ------
    SettingsError
        If the address is taken or is not this host's.
    """
    try:
        socket.bind(endpoint)
    except zmq.ZMQError as error:
        raise SettingsError(f"cannot listen there: {error.strerror.lower()}", endpoint) from None


def readable(socket: Socket) -> bool:
    """Whether a message waits; arms the socket's descriptor anew. Half the price of a recv that raises."""
    return int(socket.get(zmq.EVENTS)) & _POLLIN != 0


def publisher_socket(context: zmq.Context[Any], queue: int, max_bytes: int = MAX_SUBSCRIPTION_BYTES) -> Socket:
    """XPUB that reports every subscriber that comes or goes, also one that is killed."""
    socket = open_socket(context, zmq.XPUB, max_bytes)
    socket.setsockopt(zmq.XPUB_VERBOSER, 1)
    socket.setsockopt(zmq.SNDHWM, queue)
    return socket


def reliable_socket(context: zmq.Context[Any], queue: int) -> Socket:
    """The same for one reader that must not lose anything: a send that finds no room fails."""
    socket = publisher_socket(context, queue)
    socket.setsockopt(zmq.XPUB_NODROP, 1)
    return socket


def subscriber_socket(context: zmq.Context[Any], queue: int, max_bytes: int) -> Socket:
    """SUB with room for `queue` messages; a frame above the limits cuts the connection."""
    socket = open_socket(context, zmq.SUB, max(max_bytes, MAX_HEADER_BYTES))
    socket.setsockopt(zmq.RCVHWM, queue)
    return socket
