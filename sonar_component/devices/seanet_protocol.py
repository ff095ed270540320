"""Messages of SeaNet scanning heads on a serial line, bytes <-> dataclass, without I/O.

    '@' | length as 4 hex digits | length u16 | source | destination | count | message | 0x80 | node | payload | 0x0A

Little-endian; the length counts what comes after its hex digits and before the line feed. There is no checksum: two
equal lengths and the line feed are all that tells a message from noise. Facts from open drivers (Rock's among them)
that talk to the device.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum

_HEADER = struct.Struct("<c4sHBBBBBB")
_START, _END = b"@", b"\n"
_LAST_OF_SEQUENCE = 0x80
_LENGTHS = 7  # [bytes], from the start to the end of both lengths
_AROUND = 6  # [bytes] of a message that its length does not count
_LENGTH_MAX = 512  # [bytes], of what a client sends; the longest is 76
PC = 0xFF
NODE = 2


class MessageId(IntEnum):
    """What a message is."""

    VERSION_DATA = 1
    HEAD_DATA = 2
    ALIVE = 4
    BB_USER_DATA = 6
    REBOOT = 16
    HEAD_COMMAND = 19
    SEND_VERSION = 23
    SEND_BB_USER = 24
    SEND_DATA = 25


@dataclass(frozen=True)
class SeaNetMessage:
    """One message, whatever it holds."""

    message_id: int
    payload: bytes = b""
    source: int = PC
    destination: int = NODE
    node: int = NODE

    def encode(self) -> bytes:
        """Bytes of the message."""
        length = _HEADER.size - _LENGTHS + 2 + len(self.payload)
        # A head's echoes have no count: they may be longer than a byte can tell.
        count = 0 if self.message_id == MessageId.HEAD_DATA else min(length - 5, 255)
        head = _HEADER.pack(
            _START, b"%04X" % length, length, self.source, self.destination, count, self.message_id, _LAST_OF_SEQUENCE,
            self.node,
        )  # fmt: skip
        return head + self.payload + _END


class SeaNetParser:
    """Bytes in, messages out, wherever they are cut.

    Attributes
    ----------
    dropped : int
        Starts that began no message.
    """

    def __init__(self, length_max: int = _LENGTH_MAX) -> None:
        self._length_max = length_max
        self._buffer = bytearray()
        self.dropped = 0

    def reset(self) -> None:
        """Forget a message that has begun."""
        self._buffer.clear()

    def feed(self, data: bytes) -> list[SeaNetMessage]:
        """Take bytes; what they complete, in order."""
        self._buffer += data
        found: list[SeaNetMessage] = []
        while self._find_start():
            if len(self._buffer) < _LENGTHS:
                break
            length = self._length()
            if length is None:
                self._drop()
                continue
            whole = length + _AROUND
            if len(self._buffer) < whole:
                break
            if self._buffer[whole - 1 : whole] != _END:
                self._drop()
                continue
            _, _, _, source, destination, _, kind, _, node = _HEADER.unpack_from(self._buffer)
            found.append(SeaNetMessage(kind, bytes(self._buffer[_HEADER.size : whole - 1]), source, destination, node))
            del self._buffer[:whole]
        return found

    def _find_start(self) -> bool:
        start = self._buffer.find(_START)
        del self._buffer[: len(self._buffer) if start < 0 else start]
        return bool(self._buffer)

    def _length(self) -> int | None:
        """The length, if both agree and it is one that a client sends."""
        digits, binary = bytes(self._buffer[1:5]), int.from_bytes(self._buffer[5:7], "little")
        if digits.upper() != b"%04X" % binary or not _HEADER.size - _LENGTHS + 2 <= binary <= self._length_max:
            return None
        return binary

    def _drop(self) -> None:
        self.dropped += 1
        del self._buffer[:1]  # the next start may stand within what looked like a message
