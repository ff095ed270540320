"""Messages of the Oculus multibeam sonars, bytes <-> dataclass, without I/O.

All structures are packed and little-endian. Facts from the maker's clients and from recorded pings; the definitions
here are our own. Bearings are the device's: hundredths of a degree, positive to the right.
"""

from __future__ import annotations

import math
import socket
import struct
from dataclasses import astuple, dataclass, field, replace
from enum import IntEnum, IntFlag

import numpy as np
from numpy.typing import NDArray

OCULUS_ID = 0x4F53
HEADER = struct.Struct("<HHHHHIH")  # id, source, destination, message, version, payload size, spare

_FIRE_1 = struct.Struct("<BBBBBdddd")
_FIRE_2 = struct.Struct("<BBBBBddddI32x")
_RESULT_1 = struct.Struct("<IIddddIBdHHIII")
_RESULT_2 = struct.Struct("<IIddddddddBdHH16xIII")
FIRE_SIZES = {1: _FIRE_1.size, 2: _FIRE_2.size}  # [bytes], by version
_STATUS = struct.Struct("<IHHI24sIII6s8dd")
_ALIGNMENT = 64  # [bytes], of the image in a message: the gap after the bearings is the device's to choose


class MessageId(IntEnum):
    """What a message is."""

    FIRE = 0x15
    RESULT = 0x23
    USER_CONFIG = 0x55
    DUMMY = 0xFF


class PingRate(IntEnum):
    """Greatest ping rate that a client asks for."""

    NORMAL = 0
    HIGH = 1
    HIGHEST = 2
    LOW = 3
    LOWEST = 4
    STANDBY = 5


RATES = {  # [Hz]
    PingRate.NORMAL: 10.0, PingRate.HIGH: 15.0, PingRate.HIGHEST: 40.0, PingRate.LOW: 5.0, PingRate.LOWEST: 2.0,
}  # fmt: skip


class Flags(IntFlag):
    """Options of a fire message."""

    RANGE_IN_METRES = 0x01  # else percent of the greatest range
    DATA_16_BIT = 0x02
    SEND_GAIN = 0x04
    SIMPLE_RETURN = 0x08
    GAIN_ASSIST = 0x10
    BEAMS_512 = 0x40


DATA_32_BIT = 0x200  # among the further flags of version 2


@dataclass(frozen=True)
class Fire:
    """What a client wants.

    Attributes
    ----------
    master_mode : int
        1 low, 2 high frequency.
    ping_rate, network_speed, gamma, flags, more_flags : int
        A gamma of 0 or 255 leaves the picture linear; ``more_flags`` only in version 2.
    range : float
        [m] or [%].
    gain : float
        [%]
    speed_of_sound : float
        [m/s]; 0 leaves it to the device.
    salinity : float
        [ppt]
    version : int
        1 or 2: of the message, and of its answers.
    """

    master_mode: int = 2
    ping_rate: int = PingRate.NORMAL
    network_speed: int = 0xFF
    gamma: int = 0xFF
    flags: int = Flags.RANGE_IN_METRES | Flags.SIMPLE_RETURN
    range: float = 5.0
    gain: float = 50.0
    speed_of_sound: float = 0.0
    salinity: float = 0.0
    more_flags: int = 0
    version: int = 1

    def body(self) -> bytes:
        """Bytes after the header."""
        values = astuple(self)
        return _FIRE_2.pack(*values[:10]) if self.version == 2 else _FIRE_1.pack(*values[:9])

    def message(self, source: int = 0, destination: int = 0) -> bytes:
        """The whole message."""
        body = self.body()
        return header(MessageId.FIRE, len(body), self.version, source, destination) + body

    @property
    def sample_bytes(self) -> int:
        """Bytes of one sample in the answer."""
        if self.version == 2 and self.more_flags & DATA_32_BIT:
            return 4
        return 2 if self.flags & Flags.DATA_16_BIT else 1

    @property
    def beam_count(self) -> int:
        """Beams in the answer."""
        return 512 if self.flags & Flags.BEAMS_512 else 256


def parse_fire(body: bytes) -> Fire:
    """A fire message from the bytes after its header.

    Raises
    ------
    ValueError
        If the length is of no version, or a number is not finite.
    """
    if len(body) == _FIRE_2.size:
        fire = replace(Fire(*_FIRE_2.unpack(body)), version=2)
    elif len(body) == _FIRE_1.size:
        fire = Fire(*_FIRE_1.unpack(body))
    else:
        raise ValueError(f"a fire message has {_FIRE_1.size} or {_FIRE_2.size} bytes, got {len(body)}")
    if not all(map(math.isfinite, (fire.range, fire.gain, fire.speed_of_sound, fire.salinity))):
        raise ValueError("a fire message has numbers that are not finite")
    return fire


@dataclass(frozen=True, eq=False)
class Result:
    """One ping.

    Attributes
    ----------
    fire : Fire
        The settings that it was made with, as the device tells them.
    ping_id, status : int
    frequency : float [Hz]; temperature [degC]; pressure [bar]; heading, pitch, roll [deg]; speed_of_sound [m/s].
    start_time : float
        Of the ping, by the device's clock [s].
    range_resolution : float
        [m]
    bearings : (beams,) float64
        [deg], positive to the right.
    image : (ranges, beams) uint8, uint16 or uint32
    gains : (ranges,) uint32 or None
        Of each row: a client divides it by the square root. Sent if ``fire.flags`` has SEND_GAIN.
    """

    fire: Fire
    ping_id: int
    frequency: float
    start_time: float
    range_resolution: float
    bearings: NDArray[np.float64]
    image: NDArray[np.unsignedinteger]
    gains: NDArray[np.uint32] | None = None
    speed_of_sound: float = 1500.0
    temperature: float = 0.0
    pressure: float = 0.0
    heading: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0
    status: int = 0

    def message(self, source: int, destination: int = 0) -> bytes:
        """The whole message."""
        bearings = np.rint(self.bearings * 100).astype("<i2").tobytes()
        rows = self._rows()
        layout = _RESULT_2 if self.fire.version == 2 else _RESULT_1
        fire = self.fire.body()
        size = HEADER.size + len(fire) + layout.size
        offset = -(-(size + len(bearings)) // _ALIGNMENT) * _ALIGNMENT
        whole = offset + len(rows)
        image = (offset, len(rows), whole)
        head = header(MessageId.RESULT, whole - HEADER.size, self.fire.version, source, destination)
        gap = bytes(offset - size - len(bearings))
        return b"".join((head, fire, self._numbers(image), bearings, gap, rows))

    def _numbers(self, image: tuple[int, int, int]) -> bytes:
        ranges, beams = self.image.shape
        depth = self.image.itemsize - 1  # the code of a sample's size
        if self.fire.version == 2:
            return _RESULT_2.pack(
                self.ping_id, self.status, self.frequency, self.temperature, self.pressure, self.heading, self.pitch,
                self.roll, self.speed_of_sound, self.start_time, depth, self.range_resolution, ranges, beams, *image,
            )  # fmt: skip
        ticks = round(self.start_time * 1e9) & 0xFFFFFFFF  # nanoseconds, as recorded pings count
        return _RESULT_1.pack(
            self.ping_id, self.status, self.frequency, self.temperature, self.pressure, self.speed_of_sound, ticks,
            depth, self.range_resolution, ranges, beams, *image,
        )  # fmt: skip

    def _rows(self) -> bytes:
        samples = np.ascontiguousarray(self.image).astype(self.image.dtype.newbyteorder("<"), copy=False)
        if self.gains is None:
            return samples.tobytes()
        gains = self.gains.astype("<u4").view(np.uint8).reshape(-1, 4)
        return np.hstack([gains, samples.view(np.uint8)]).tobytes()


def parse_result(message: bytes) -> Result:
    """A ping from a whole message; what a client does.

    Raises
    ------
    ValueError
        If it is not a result, or its sizes contradict each other.
    """
    if len(message) < HEADER.size:
        raise ValueError(f"a result has a header of {HEADER.size} bytes, got {len(message)}")
    mark, _, _, kind, version, payload, _ = HEADER.unpack_from(message)
    if (mark, kind) != (OCULUS_ID, MessageId.RESULT) or version not in (1, 2) or payload + HEADER.size != len(message):
        raise ValueError("is not one whole result of version 1 or 2")
    fire_layout, layout = (_FIRE_2, _RESULT_2) if version == 2 else (_FIRE_1, _RESULT_1)
    size = HEADER.size + fire_layout.size + layout.size
    if len(message) < size:
        raise ValueError(f"a result of version {version} has at least {size} bytes, got {len(message)}")
    fire = replace(Fire(*fire_layout.unpack_from(message, HEADER.size)), version=version)
    n = layout.unpack_from(message, HEADER.size + fire_layout.size)
    depth, resolution, ranges, beams, offset, image_size, whole = n[-7:]
    row = beams * (depth + 1) + (4 if fire.flags & Flags.SEND_GAIN else 0)
    if depth not in (0, 1, 3) or whole != len(message) or image_size != ranges * row or offset + image_size != whole:
        raise ValueError("sizes of the image contradict each other")
    if offset < size + 2 * beams:
        raise ValueError("the image begins before the bearings end")
    bearings = np.frombuffer(message, "<i2", beams, size) / 100
    rows = np.frombuffer(message, np.uint8, image_size, offset).reshape(ranges, row)
    with_gains = bool(fire.flags & Flags.SEND_GAIN)
    gains = np.ascontiguousarray(rows[:, :4]).view("<u4").ravel() if with_gains else None
    image = np.ascontiguousarray(rows[:, 4:] if with_gains else rows).view(f"<u{depth + 1}")
    result = Result(fire, n[0], n[2], 0.0, resolution, bearings, image, gains, status=n[1], temperature=n[3],
                    pressure=n[4])  # fmt: skip
    if version == 1:
        return replace(result, speed_of_sound=n[5], start_time=n[6] * 1e-9)
    return replace(result, heading=n[5], pitch=n[6], roll=n[7], speed_of_sound=n[8], start_time=n[9])


@dataclass(frozen=True)
class Status:
    """What the device says of itself once a second.

    Attributes
    ----------
    device_id, device_type, part_number : int
    status : int
        Its lowest three bits are 3 while the device runs.
    address, mask, client : str
        IPv4 addresses; ``client`` is 0.0.0.0 while nobody is connected.
    mac : bytes
    temperature, pressure : float
        [degC], [bar]
    """

    device_id: int
    part_number: int
    address: str
    client: str = "0.0.0.0"
    mask: str = "255.255.255.0"
    mac: bytes = field(default=bytes.fromhex("024f43554c53"))  # locally administered, so that it is nobody's
    temperature: float = 0.0
    pressure: float = 0.0
    status: int = 3
    device_type: int = 1

    def message(self, source: int) -> bytes:
        """The whole message."""
        ips = (_number(ip) for ip in (self.address, self.mask, self.client))
        temperatures = (self.temperature,) * 8
        return header(0, _STATUS.size, 1, source) + _STATUS.pack(
            self.device_id, self.device_type, self.part_number, self.status, bytes(24), *ips, self.mac, *temperatures,
            self.pressure,
        )  # fmt: skip


def header(message_id: int, payload_size: int, version: int = 1, source: int = 0, destination: int = 0) -> bytes:
    """The 16 bytes in front of each message."""
    return HEADER.pack(OCULUS_ID, source, destination, message_id, version, payload_size, 0)


def _number(address: str) -> int:
    return int.from_bytes(socket.inet_aton(address), "little")  # its first octet is the lowest byte
