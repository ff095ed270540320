"""What SeaNet messages hold, payload bytes <-> dataclass, without I/O.

Facts from open drivers (Rock's among them) that talk to the device. Angles are in sixteenths of a gradian: 6400 to a
turn, clockwise seen from above.
"""

from __future__ import annotations

import struct
from dataclasses import astuple, dataclass
from enum import IntFlag

TURN = 6400  # [1/16 gradian]
AHEAD = 3200  # [1/16 gradian]
TICK = 640e-9  # [s], unit of the interval between samples


class Control(IntFlag):
    """Bits of the head's control word."""

    ADC_8_BIT = 0x0001
    CONTINUOUS = 0x0002
    SCAN_RIGHT = 0x0004
    INVERTED = 0x0008
    MOTOR_OFF = 0x0010
    TRANSMITTER_OFF = 0x0020


@dataclass(frozen=True)
class HeadCommand:
    """Settings of the head; a second set of gains that some heads take (``more``) is kept as it came.

    Attributes
    ----------
    kind : int
        0x1D with the second set, 0x01 without.
    control : int
        See ``Control``.
    tx_1, tx_2, rx_1, rx_2 : int
        Frequencies: Hz * 2**32 / 32e6; 0 leaves them to the head.
    range_scale : int
        [dm]
    left, right, step : int
        Sector and step [1/16 gradian].
    ad_span, ad_low : int
        Window of the echoes that 4-bit samples show, of 255.
    gain_1 : int
        0 to 210.
    ad_interval : int
        Between two samples [640 ns].
    bin_count : int
    """

    kind: int = 0x01
    control: int = 0
    head_type: int = 11
    tx_1: int = 0
    tx_2: int = 0
    rx_1: int = 0
    rx_2: int = 0
    pulse: int = 0
    range_scale: int = 100
    left: int = 0
    right: int = 0
    ad_span: int = 255
    ad_low: int = 0
    gain_1: int = 105
    gain_2: int = 105
    slope_1: int = 0
    slope_2: int = 0
    motor_time: int = 25
    step: int = 16
    ad_interval: int = 100
    bin_count: int = 300
    max_ad: int = 500
    lockout: int = 100
    minor_axis: int = 1600
    major_axis: int = 1
    control_2: int = 0
    scan_z: int = 0
    more: bytes = b""

    def payload(self) -> bytes:
        """Bytes of the payload."""
        return _COMMAND.pack(*astuple(self)[:-1]) + self.more


_COMMAND = struct.Struct("<BHB4IHHHHBBBBHHBBHHHHHBBH")
_MORE = 16  # [bytes]
_WITH_MORE = 0x1D


def parse_head_command(payload: bytes) -> HeadCommand:
    """Settings from a payload.

    Raises
    ------
    ValueError
        If its length is not that of its kind.
    """
    wanted = _COMMAND.size + (_MORE if payload[:1] == bytes([_WITH_MORE]) else 0)
    if len(payload) != wanted:
        raise ValueError(f"a head command of this kind has {wanted} bytes, got {len(payload)}")
    values = (*_COMMAND.unpack_from(payload), payload[_COMMAND.size :])
    return HeadCommand(*values)


@dataclass(frozen=True)
class HeadData:
    """Echoes of one ping, with the settings that they were made with.

    Attributes
    ----------
    bearing : int
        Where the head looked [1/16 gradian].
    data : bytes
        A sample a byte, or two samples of 4 bits each, the first one in the high half.
    """

    head_status: int
    sweep_code: int
    control: int
    range_scale: int
    tx: int
    gain: int
    slope: int
    ad_span: int
    ad_low: int
    heading_offset: int
    ad_interval: int
    left: int
    right: int
    step: int
    bearing: int
    data: bytes

    def payload(self) -> bytes:
        """Bytes of the payload."""
        values = astuple(self)[:-1]
        size = _ECHOES.size + len(self.data)
        return _ECHOES.pack(size, _DEVICE_TYPE, *values, len(self.data)) + self.data


_ECHOES = struct.Struct("<HBBBHHIBHBBHHHHBHH")
_DEVICE_TYPE = 0x11


def parse_head_data(payload: bytes) -> HeadData:
    """Echoes from a payload; what a client does.

    Raises
    ------
    ValueError
        If its sizes contradict each other.
    """
    if len(payload) < _ECHOES.size:
        raise ValueError(f"echoes have at least {_ECHOES.size} bytes, got {len(payload)}")
    size, _, *values, count = _ECHOES.unpack_from(payload)
    if size != len(payload) or count != len(payload) - _ECHOES.size:
        raise ValueError(f"echoes of {len(payload)} bytes say that they have {size}, {count} of them samples")
    values.append(payload[_ECHOES.size :])
    return HeadData(*values)


@dataclass(frozen=True)
class Alive:
    """What a head says once a second.

    Attributes
    ----------
    milliseconds : int
        Since it woke up.
    position : int
        [1/16 gradian]
    head : int
        See ``HeadState``.
    """

    milliseconds: int
    position: int
    head: int
    first: int = 1

    def payload(self) -> bytes:
        """Bytes of the payload."""
        return _ALIVE.pack(self.first, self.milliseconds & 0xFFFFFFFF, self.position, self.head)


_ALIVE = struct.Struct("<BIHB")


def parse_alive(payload: bytes) -> Alive:
    """Sign of life from a payload.

    Raises
    ------
    ValueError
        If its length is another.
    """
    if len(payload) != _ALIVE.size:
        raise ValueError(f"a sign of life has {_ALIVE.size} bytes, got {len(payload)}")
    first, milliseconds, position, head = _ALIVE.unpack(payload)
    return Alive(milliseconds, position, head, first)


class HeadState(IntFlag):
    """Bits of a sign of life."""

    IN_CENTRE = 0x01
    CENTRED = 0x02
    MOTORING = 0x04
    MOTOR_ON = 0x08
    DIRECTION = 0x10
    SCANNING = 0x20
    NO_PARAMETERS = 0x40
    CONFIGURED = 0x80
