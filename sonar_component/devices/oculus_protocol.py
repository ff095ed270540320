"""How the messages of an Oculus client are found in a stream of bytes, without I/O."""

from __future__ import annotations

import struct
from dataclasses import dataclass

from sonar_component.devices.oculus_messages import FIRE_SIZES, HEADER, OCULUS_ID, Fire, MessageId, parse_fire

_START = struct.pack("<H", OCULUS_ID)
_PAYLOAD_MAX = 1 << 12  # [bytes], of what a client sends: a fire message has 73, anything much longer is garbage


@dataclass(frozen=True)
class Unknown:
    """A message that is not for this device."""

    message_id: int
    payload: bytes


class OculusParser:
    """Bytes of a client in, messages out, wherever they are cut.

    A fire message is measured by its version and not by its header alone, since a client is known that writes a payload
    size of 0 there. What is not a message is passed over up to the next start.

    Attributes
    ----------
    dropped : int
        Bytes passed over, and fire messages that could not be read.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.dropped = 0

    def feed(self, data: bytes) -> list[Fire | Unknown]:
        """Take bytes; what they complete, in order."""
        self._buffer += data
        found: list[Fire | Unknown] = []
        while self._find_start():
            _, _, _, kind, version, size, _ = HEADER.unpack_from(self._buffer)
            if kind == MessageId.FIRE and size == 0:
                size = FIRE_SIZES[2 if version == 2 else 1]
            if size > _PAYLOAD_MAX:
                self._drop(len(_START))
                continue
            if len(self._buffer) < HEADER.size + size:
                break
            payload = bytes(self._buffer[HEADER.size : HEADER.size + size])
            del self._buffer[: HEADER.size + size]
            try:
                found.append(parse_fire(payload) if kind == MessageId.FIRE else Unknown(kind, payload))
            except ValueError:
                self.dropped += 1
        return found

    def _drop(self, count: int) -> None:
        self.dropped += count
        del self._buffer[:count]

    def _find_start(self) -> bool:
        start = self._buffer.find(_START)
        if start < 0:
            start = len(self._buffer) - (self._buffer[-1:] == _START[:1])
        self._drop(start)
        return len(self._buffer) >= HEADER.size
