"""Frames of the Ping protocol, bytes <-> dataclass, without I/O.

    'B' 'R' | payload length u16 | message id u16 | source u8 | destination u8 | payload | checksum u16

Little-endian; the checksum is the sum of all bytes before it, modulo 65536. Source: the public definitions of the
protocol, bluerobotics/ping-protocol; what a device does with damaged frames follows the parser that the maker's open
firmware and clients share: a bad checksum drops the frame, a length beyond the buffer is forgotten at once, and a
truncated frame waits without a timeout and so swallows what comes after it.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

_START = b"BR"
_HEADER = struct.Struct("<2sHHBB")
_CHECKSUM = struct.Struct("<H")
_LINE_BREAK = ord("U")
PAYLOAD_MAX = 512  # [bytes], buffer of the device for one payload; the longest that a client sends is 16


@dataclass(frozen=True)
class PingFrame:
    """One frame.

    Attributes
    ----------
    message_id : int
    payload : bytes
    source, destination : int
        Device ids; a client is 0.
    """

    message_id: int
    payload: bytes = b""
    source: int = 0
    destination: int = 0


@dataclass(frozen=True)
class LineBreak:
    """A ``U`` outside of any frame: what a serial client sends so that the device finds its baud rate."""


def encode(frame: PingFrame) -> bytes:
    """Bytes of a frame."""
    head = _HEADER.pack(_START, len(frame.payload), frame.message_id, frame.source, frame.destination)
    body = head + frame.payload
    return body + _CHECKSUM.pack(sum(body) & 0xFFFF)


class PingParser:
    """Bytes in, frames out, wherever they are cut.

    Attributes
    ----------
    dropped : int
        Frames that were dropped for their checksum or length.
    """

    def __init__(self, payload_max: int = PAYLOAD_MAX) -> None:
        self._payload_max = payload_max
        self._buffer = bytearray()
        self.dropped = 0

    def reset(self) -> None:
        """Forget a frame that has begun, as a line break makes the device do."""
        self._buffer.clear()

    def feed(self, data: bytes) -> list[PingFrame | LineBreak]:
        """Take bytes; what they complete, in order."""
        self._buffer += data
        found: list[PingFrame | LineBreak] = []
        while self._find_start(found):
            if len(self._buffer) < _HEADER.size:
                break
            _, length, message_id, source, destination = _HEADER.unpack_from(self._buffer)
            if length > self._payload_max:
                self._drop(4)  # start and length; what follows is looked at afresh
                continue
            end = _HEADER.size + length
            if len(self._buffer) < end + _CHECKSUM.size:
                break
            (checksum,) = _CHECKSUM.unpack_from(self._buffer, end)
            if checksum != sum(memoryview(self._buffer)[:end]) & 0xFFFF:
                self._drop(end + _CHECKSUM.size)
                continue
            found.append(PingFrame(message_id, bytes(self._buffer[_HEADER.size : end]), source, destination))
            del self._buffer[: end + _CHECKSUM.size]
        return found

    def _drop(self, count: int) -> None:
        self.dropped += 1
        del self._buffer[:count]

    def _find_start(self, found: list[PingFrame | LineBreak]) -> bool:
        """Cut off what stands before the next frame; whether one may begin."""
        start = self._buffer.find(_START)
        if start < 0:
            # The last byte may be the first half of a start.
            start = len(self._buffer) - (self._buffer[-1:] == _START[:1])
        if _LINE_BREAK in self._buffer[:start]:
            found.append(LineBreak())
        del self._buffer[:start]
        # The length is judged as soon as it is there, as the device does: not when the whole header is.
        if len(self._buffer) >= 4 and int.from_bytes(self._buffer[2:4], "little") > self._payload_max:
            self._drop(4)
            return self._find_start(found)
        return len(self._buffer) > 1
