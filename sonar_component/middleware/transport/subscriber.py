"""One SUB per connection, drained to the mailbox of the connection's policy by whoever is awake.

HWM 1 or CONFLATE were the alternatives for "latest only": the first leaves 785 ms old frames in the pipes (30 Hz to a
5 Hz reader, 1 MB), the second loses all but the last part of a multipart message.
"""

from __future__ import annotations

import logging
import os
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import zmq

from sonar_component.middleware.codec import WireError, decode, unpack
from sonar_component.middleware.layout import Decoder as LayoutDecoder
from sonar_component.middleware.policy import Received
from sonar_component.middleware.ports import Connection
from sonar_component.middleware.schema import Schema
from sonar_component.middleware.transport.rejections import Rejections
from sonar_component.middleware.transport.sockets import Socket, readable

_log = logging.getLogger("transport")
_NOBLOCK = int(zmq.NOBLOCK)
_MAX_PARTS = 258  # topic, header and as many buffers as a header may describe
Decoder = Callable[[dict[str, Any], list[Any]], Any]


class Subscriber:
    """Receives for one connection; counts what is lost and what breaks the format."""

    def __init__(self, socket: Socket, connection: Connection, decoder: Decoder | Schema, reader: str) -> None:
        self._socket, self._connection, self._mailbox = socket, connection, connection.mailbox
        self.rejected = Rejections(reader)
        self.fd = int(socket.getsockopt(zmq.FD))
        self._decode: Decoder = _decoder(decoder) if isinstance(decoder, Schema) else decoder
        self._known = LayoutDecoder(decoder) if isinstance(decoder, Schema) else None
        self._lock = threading.Lock()
        self._topic = connection.source.encode() + b"\0"
        self._own = b"@" + os.urandom(8).hex().encode()
        self._run, self._seq = "", 0
        self._trying = self._cut = self._closed = False
        self.bytes = 0
        self.on_restart: Callable[[str], None] = lambda source: None
        socket.subscribe(self._topic)
        if connection.mailbox.policy.init:
            socket.subscribe(self._own)

    def serve(self, told: bool = False) -> None:
        """Take everything that has come; `told` by the descriptor, the first message is taken without asking for it."""
        with self._lock:
            if told and not self._closed and not self._mailbox.full:
                with suppress(zmq.Again):  # it also tells of other things
                    self._take(self._socket.recv(_NOBLOCK, False))
            # Asking for EVENTS puts the descriptor to sleep; what a full mailbox has no room for stays in the socket.
            while not self._closed and readable(self._socket) and not self._mailbox.full:
                self._take(self._socket.recv(_NOBLOCK, False))

    def connect(self, endpoint: str) -> None:
        """Connect, or connect anew: libzmq gives up on a peer that once sent too large a frame."""
        with self._lock:
            if self._closed:
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
            self._closed = True
            self._socket.close()

    def _take(self, frame: zmq.Frame) -> None:
        topic, parts = frame.bytes, 1
        frames: list[Any] = []  # the header and its arrays
        while frame.more:
            frame = self._socket.recv(0, False)
            parts += 1
            if parts <= _MAX_PARTS:
                frames.append(frame.buffer)
        try:
            if topic != self._topic and topic != self._own:
                raise WireError("message for another topic")
            if not frames or parts > _MAX_PARTS:
                raise WireError("message has too many parts" if frames else "message has no header")
            self._accept(frames[0], frames[1:])
        except WireError as error:
            self._reject(error)

    def _accept(self, frame: memoryview, buffers: list[memoryview]) -> None:
        known = self._known.decode(frame, buffers) if self._known is not None else None
        if known is None:
            self._accept_new(frame, buffers)
        elif known[0] > self._seq:
            self._deliver(*known, frame, buffers)

    def _accept_new(self, frame: memoryview, buffers: list[memoryview]) -> None:
        """A message whose header must be read as a stranger's."""
        header = unpack(frame)
        if header["src"] != self._connection.source:
            raise WireError("header names another source than its topic")
        restarted = header["run"] != self._run
        if not restarted and header["seq"] <= self._seq:
            return  # the greeting repeats a sample that came the usual way
        sample = self._decode(header, buffers)
        if self._known is not None:
            self._known.learn(frame, header)
        if restarted:
            before = self._run
            self._run, self._seq, self._cut = header["run"], header["seq"] - 1, False
            if before:
                self._count_restart()
        self._deliver(header["seq"], header["t"], sample, frame, buffers)

    def _deliver(self, seq: int, data_time: int, sample: Any, frame: memoryview, buffers: list[memoryview]) -> None:
        if self._cut:
            self._reject("connection was cut: a frame above the limit, or no heartbeat")
            self._cut = False
        self._mailbox.account.lost += seq - self._seq - 1
        self._seq = seq
        self.bytes += len(frame) + sum(map(len, buffers))
        self._connection.deliver(Received(sample, data_time, seq, time.monotonic()))

    def _count_restart(self) -> None:
        self._mailbox.account.restarts += 1
        try:
            self.on_restart(self._connection.source)
        except Exception:  # a task's own hook; whose thread we are in must go on
            _log.exception("upstream_restarted failed")

    def _reject(self, reason: object) -> None:
        self.rejected.add(self._connection.source, str(reason))
        self._mailbox.account.rejected = self.rejected.as_dict()


def _decoder(schema: Schema) -> Decoder:
    return lambda header, buffers: decode(schema, header, buffers)
