"""One SUB per connection, drained to the mailbox of the connection's policy by whoever is awake.

HWM 1 or CONFLATE were the alternatives for "latest only": the first leaves 785 ms old frames in the pipes (30 Hz to a
5 Hz reader, 1 MB), the second loses all but the last part of a multipart message.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import zmq

from sonar_component.middleware.codec import WireError, decode, unpack
from sonar_component.middleware.policy import Received
from sonar_component.middleware.ports import Connection
from sonar_component.middleware.schema import Schema
from sonar_component.middleware.transport.rejections import Rejections
from sonar_component.middleware.transport.sockets import Socket, readable

_MAX_PARTS = 258  # topic, header and as many buffers as a header may describe
Decoder = Callable[[dict[str, Any], list[Any]], Any]


class Subscriber:
    """Receives for one connection; counts what is lost and what breaks the format."""

    def __init__(self, socket: Socket, connection: Connection, decoder: Decoder | Schema, reader: str) -> None:
        self._socket, self._connection = socket, connection
        self.rejected = Rejections(reader)
        self.fd = int(socket.getsockopt(zmq.FD))
        self._decode: Decoder = _decoder(decoder) if isinstance(decoder, Schema) else decoder
        self._lock = threading.Lock()
        self._topic = connection.source.encode() + b"\0"
        self._own = b"@" + os.urandom(8).hex().encode()
        self._run, self._seq = "", 0
        self._trying = False
        self._cut = False
        self.bytes = 0
        self.on_restart: Callable[[str], None] = lambda source: None
        socket.subscribe(self._topic)
        if connection.mailbox.policy.init:
            socket.subscribe(self._own)

    def serve(self) -> None:
        """Take everything that has come."""
        with self._lock:
            # Asking for EVENTS puts the descriptor to sleep; what a full mailbox has no room for stays in the socket.
            while not self._socket.closed and readable(self._socket):
                if self._connection.mailbox.full:
                    return
                self._take(self._socket.recv(zmq.NOBLOCK))

    def connect(self, endpoint: str) -> None:
        """Connect, or connect anew: libzmq gives up on a peer that once sent too large a frame."""
        with self._lock:
            if self._socket.closed:
                return
            self._trying = False
            if self._run or self._cut:
                with suppress(zmq.ZMQError):  # it has forgotten the address
                    self._socket.disconnect(endpoint)
            self._socket.connect(endpoint)
        self.serve()  # libzmq may have taken the descriptor's news while it connected

    def disconnected(self) -> bool:
        """Remember that the connection broke: what comes next tells why. True if it was whole before."""
        first, self._cut, self._trying = not self._trying, True, True
        return first

    def close(self) -> None:
        """Close the socket."""
        with self._lock:
            self._socket.close()

    def _take(self, topic: bytes) -> None:
        header: bytes | None = None
        buffers: list[Any] = []
        parts = 1
        while self._socket.getsockopt(zmq.RCVMORE):
            parts += 1
            if header is None:
                header = self._socket.recv()
            elif parts <= _MAX_PARTS:
                buffers.append(self._socket.recv(copy=False).buffer)
            else:
                self._socket.recv(copy=False)
        try:
            if topic not in (self._topic, self._own):
                raise WireError("message for another topic")
            if header is None or parts > _MAX_PARTS:
                raise WireError("message has too many parts" if header else "message has no header")
            self._accept(unpack(header), buffers, len(header))
        except WireError as error:
            self._reject(error)

    def _accept(self, header: dict[str, Any], buffers: list[Any], size: int) -> None:
        if header["src"] != self._connection.source:
            raise WireError("header names another source than its topic")
        restarted = header["run"] != self._run
        if not restarted and header["seq"] <= self._seq:
            return  # the greeting repeats a sample that came the usual way
        sample = self._decode(header, buffers)
        account = self._connection.mailbox.account
        if restarted:
            self._count_restart(header)
        else:
            account.lost += header["seq"] - self._seq - 1
        if self._cut and not restarted:
            self.rejected.add(self._connection.source, "connection was cut: a frame above the limit, or no heartbeat")
            self._connection.mailbox.account.rejected = self.rejected.as_dict()
        self._cut = False
        self._run, self._seq = header["run"], header["seq"]
        self.bytes += size + sum(buffer.nbytes for buffer in buffers)
        self._connection.deliver(Received(sample, header["t"], header["seq"], time.monotonic()))

    def _count_restart(self, header: dict[str, Any]) -> None:
        if self._run:
            self._connection.mailbox.account.restarts += 1
            self.on_restart(self._connection.source)

    def _reject(self, error: WireError) -> None:
        self.rejected.add(self._connection.source, str(error))
        self._connection.mailbox.account.rejected = self.rejected.as_dict()


def _decoder(schema: Schema) -> Decoder:
    return lambda header, buffers: decode(schema, header, buffers)
