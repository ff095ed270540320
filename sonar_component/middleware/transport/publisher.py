"""One XPUB per output port: its own queue, its own count of readers.

A late joiner subscribes to the topic and to a name of its own choice, ``@`` and anything; the last sample is sent again
under that name, to it alone. ZeroMQ's welcome message was the alternative: it carries one frame only, so every write
would have to copy the whole sample into it in case somebody comes; this way nothing is done until somebody does.
"""

from __future__ import annotations

import logging
import os
import threading
from typing import Any

import zmq

from sonar_component.middleware.codec import ENVELOPE
from sonar_component.middleware.layout import Encoder
from sonar_component.middleware.ports import OutputPort
from sonar_component.middleware.transport.rejections import Rejections, peer_of
from sonar_component.middleware.transport.sockets import Socket, readable

_log = logging.getLogger("transport")
RUN_ID = os.urandom(8).hex()  # of this process, in every header
_LAST = int(zmq.NOBLOCK)  # plain numbers: zmq's own take a microsecond to be joined, ten when that is rare
_MORE = int(zmq.NOBLOCK | zmq.SNDMORE)
_NO_COPY_BYTES = 1 << 16  # from here on libzmq borrows the array instead of copying it (measured: 64 kB)


class Publisher:
    """Sends what a port writes, and knows who listens.

    Attributes
    ----------
    rejected : subscription messages that no reader of ours sends.
    """

    def __init__(self, socket: Socket, port: OutputPort[Any], clock_name: str = "wall") -> None:
        self._socket, self._port, self.clock_name = socket, port, clock_name
        self._send_part = super(zmq.Socket, socket).send  # the plain one: that of Socket itself takes options of drafts
        self._closed = False
        self.fd = int(socket.getsockopt(zmq.FD))
        self.topic = port.full_name.encode() + b"\0"
        schema = port.schema
        envelope: dict[str, Any] = {
            "e": ENVELOPE, "type": schema.name, "sv": [schema.major, schema.minor], "sh": schema.hash,
            "src": port.full_name, "run": RUN_ID, "clk": clock_name,
        }  # fmt: skip
        self._encoder = Encoder(schema, envelope)
        self._lock = threading.Lock()
        self._subscribers = 0
        self._outlets: list[Publisher] = []
        self.sent_bytes = 0
        self.rejected = Rejections(port.full_name)

    def listeners(self) -> int:
        """Readers in other processes now."""
        count = self._subscribers
        for outlet in self._outlets:
            count += outlet.listeners()
        return count

    def add(self, outlet: Publisher) -> None:
        """Send through one more socket: for a reliable reader, or for other hosts."""
        outlet.rejected = self.rejected
        self._outlets = [*self._outlets, outlet]

    def remove(self, outlet: Publisher) -> None:
        """Send no more through that socket."""
        self._outlets = [other for other in self._outlets if other is not outlet]

    def publish(self, sample: Any, time: int, seq: int) -> bool:
        """Send to whoever is there; nothing is packed for nobody. False if a reliable reader has no room."""
        if not self._subscribers and not self.listeners():
            return True
        frames = [self.topic, *self._encoder.encode(sample, time, seq)]
        self._offer(frames)
        return not self._outlets or all([outlet._offer(frames) for outlet in self._outlets])

    def _offer(self, frames: list[Any]) -> bool:
        with self._lock:
            try:
                return self._send(frames)
            finally:
                self._take_subscriptions()  # sending may have swallowed the descriptor's news of them

    def serve(self) -> None:
        """Take subscriptions."""
        with self._lock:
            self._take_subscriptions()

    def close(self) -> None:
        """Close the socket."""
        with self._lock:
            self._closed = True
            self._socket.close()

    def _send(self, frames: list[Any]) -> bool:
        send, last = self._send_part, len(frames) - 1
        size = 0
        try:
            for index, frame in enumerate(frames):
                length = len(frame) if index < 2 else frame.nbytes
                send(frame, _MORE if index < last else _LAST, length < _NO_COPY_BYTES or index < 2)
                size += length
            self.sent_bytes += size
        except zmq.Again:  # on the first frame only: libzmq counts whole messages
            return False
        except zmq.ZMQError:
            if not self._closed:  # its reader has just left
                raise
        return True

    def _take_subscriptions(self) -> None:
        while not self._closed and readable(self._socket):
            frames = self._socket.recv_multipart(zmq.NOBLOCK, copy=False)
            self._subscription(frames[0].bytes, len(frames) > 1, frames[0])

    def _subscription(self, message: bytes, more: bool, frame: zmq.Frame) -> None:
        joins, name = message[:1], message[1:]
        if more or joins not in (b"\0", b"\1"):
            self.rejected.add(peer_of(frame), "message is not a subscription")
        elif name == self.topic:
            self._subscribers = max(0, self._subscribers + (1 if joins == b"\1" else -1))
        elif name.startswith(b"@") and len(name) <= 128:
            if joins == b"\1":
                self._greet(name)
        else:
            self.rejected.add(peer_of(frame), "subscription to a topic that is not this port's")

    def _greet(self, name: bytes) -> None:
        """Give the last sample to one reader; a header with nothing in it where there is none yet."""
        last = self._port.last
        if last is None:
            return
        try:
            frames = self._encoder.encode(last.sample, last.time, last.seq)
        except Exception as error:  # it was written while nobody listened, so its writer was not told
            _log.warning("the last sample of %s cannot be sent: %s", self._port.full_name, error)
            return
        self._send([name, *frames])
