"""The first version of the .oculus log, as the maker's viewer writes it: bytes of a file header and of its items.

Facts from the reader of the oculus-python package. Times are seconds since 1970.
"""

from __future__ import annotations

import struct

_FILE = struct.Struct("<2I16s2H4xqd")  # mark, size, source, version, encryption, key, time
_ITEM = struct.Struct("<2I2H4xdH2x2I4x")  # mark, size, type, version, time, compression, original size, size
_FILE_MARK, _ITEM_MARK = 0x11223344, 0xAABBCCDD
_PING = 10


def file_header(time: float) -> bytes:
    """The first bytes of a log that begins at `time`."""
    return _FILE.pack(_FILE_MARK, _FILE.size, b"Oculus", 1, 0, 0, time)


def item(message: bytes, time: float) -> bytes:
    """One message of the device, as it was sent."""
    return _ITEM.pack(_ITEM_MARK, _ITEM.size, _PING, 1, time, 0, len(message), len(message)) + message
