"""Messages of the Ping360 scanning sonar, payload bytes <-> dataclass, without I/O.

Field order and units: the public definitions common.json and ping360.json of bluerobotics/ping-protocol.
Angles are in gradians (400 to a turn), sample periods in ticks of 25 ns, frequencies in kHz, pulses in us.
"""

from __future__ import annotations

import dataclasses
import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, TypeVar, cast

from sonar_component.devices.ping_protocol import PingFrame, encode

M = TypeVar("M", bound="Message")
TICK = 25e-9  # [s], unit of the sample period
TURN = 400  # [gradians]
_COUNT = struct.Struct("<H")


@dataclass(frozen=True)
class Message:
    """Base: the numbers of ``layout`` in the order of the fields, then the last field as bytes if ``tail`` says so."""

    message_id: ClassVar[int]
    layout: ClassVar[struct.Struct]
    tail: ClassVar[str] = ""  # "": none, "text": the rest, "counted": u16 length, then as many bytes

    def frame(self, source: int = 0, destination: int = 0) -> bytes:
        """The whole message as it goes over the wire."""
        return encode(PingFrame(self.message_id, self.payload(), source, destination))

    def payload(self) -> bytes:
        """Bytes of the payload.

        Raises
        ------
        struct.error
            If a value does not fit its field.
        """
        values = [getattr(self, field.name) for field in dataclasses.fields(self)]
        if not self.tail:
            return self.layout.pack(*values)
        count = _COUNT.pack(len(values[-1])) if self.tail == "counted" else b""
        return self.layout.pack(*values[:-1]) + count + bytes(values[-1])

    @classmethod
    def parse(cls: type[M], payload: bytes) -> M:
        """Read a payload.

        Raises
        ------
        ValueError
            If its length is not that of the message.
        """
        size = cls.layout.size + (_COUNT.size if cls.tail == "counted" else 0)
        if len(payload) < size or (not cls.tail and len(payload) > size):
            raise ValueError(f"payload of message {cls.message_id} must have {size} bytes, got {len(payload)}")
        values, make = cls.layout.unpack_from(payload), cast(Callable[..., M], cls)
        if not cls.tail:
            return make(*values)
        rest = payload[size:]
        if cls.tail == "counted":
            (length,) = _COUNT.unpack_from(payload, cls.layout.size)
            if len(rest) != length:
                raise ValueError(f"data of message {cls.message_id} must have {length} bytes, got {len(rest)}")
        return make(*values, rest)


@dataclass(frozen=True)
class Ack(Message):
    """A setting was taken."""

    message_id, layout = 1, struct.Struct("<H")
    acked_id: int


@dataclass(frozen=True)
class Nack(Message):
    """A setting was refused; the text must not be empty, since clients lose such a message."""

    message_id, layout, tail = 2, struct.Struct("<H"), "text"
    nacked_id: int
    text: bytes


@dataclass(frozen=True)
class DeviceInformation(Message):
    """Which device this is; type 2 is the scanning sonar."""

    message_id, layout = 4, struct.Struct("<BBBBBB")
    device_type: int
    device_revision: int
    firmware_major: int
    firmware_minor: int
    firmware_patch: int
    reserved: int = 0


@dataclass(frozen=True)
class ProtocolVersion(Message):
    """Version of the protocol."""

    message_id, layout = 5, struct.Struct("<BBBB")
    major: int
    minor: int
    patch: int
    reserved: int = 0


@dataclass(frozen=True)
class GeneralRequest(Message):
    """Ask for a message by its id."""

    message_id, layout = 6, struct.Struct("<H")
    requested_id: int


@dataclass(frozen=True)
class SetDeviceId(Message):
    """Change the device's own id."""

    message_id, layout = 2000, struct.Struct("<BB")
    device_id: int
    reserved: int = 0


@dataclass(frozen=True)
class DeviceData(Message):
    """State of the sonar, with one ping in ``data`` or none."""

    message_id, layout, tail = 2300, struct.Struct("<BBHHHHH"), "counted"
    mode: int
    gain_setting: int
    angle: int
    transmit_duration: int
    sample_period: int
    transmit_frequency: int
    number_of_samples: int
    data: bytes = b""


@dataclass(frozen=True)
class AutoDeviceData(Message):
    """One ping of a scan that the device steps by itself."""

    message_id, layout, tail = 2301, struct.Struct("<BBHHHHHHBBH"), "counted"
    mode: int
    gain_setting: int
    angle: int
    transmit_duration: int
    sample_period: int
    transmit_frequency: int
    start_angle: int
    stop_angle: int
    num_steps: int
    delay: int
    number_of_samples: int
    data: bytes = b""


@dataclass(frozen=True)
class Reset(Message):
    """Back to the state at power-up."""

    message_id, layout = 2600, struct.Struct("<BB")
    bootloader: int
    reserved: int = 0


@dataclass(frozen=True)
class Transducer(Message):
    """Take these settings, turn there and, if ``transmit``, ping once."""

    message_id, layout = 2601, struct.Struct("<BBHHHHHBB")
    mode: int
    gain_setting: int
    angle: int
    transmit_duration: int
    sample_period: int
    transmit_frequency: int
    number_of_samples: int
    transmit: int
    reserved: int = 0


@dataclass(frozen=True)
class AutoTransmit(Message):
    """Take these settings and scan from ``start_angle`` to ``stop_angle`` until told otherwise."""

    message_id, layout = 2602, struct.Struct("<BBHHHHHHBB")
    mode: int
    gain_setting: int
    transmit_duration: int
    sample_period: int
    transmit_frequency: int
    number_of_samples: int
    start_angle: int
    stop_angle: int
    num_steps: int
    delay: int


@dataclass(frozen=True)
class MotorOff(Message):
    """Stop scanning and let the motor go."""

    message_id, layout = 2903, struct.Struct("")


MESSAGES: dict[int, type[Message]] = {cls.message_id: cls for cls in Message.__subclasses__()}

LIMITS: dict[str, tuple[int, int]] = {  # field -> least and greatest that the device takes
    "mode": (0, 1),  # documented as 1, but the maker's own client sends 0 with every ping
    "gain_setting": (0, 2),
    "angle": (0, TURN - 1),
    "transmit_duration": (1, 1000),
    "sample_period": (80, 40000),
    "transmit_frequency": (500, 1000),
    "number_of_samples": (200, 1200),
    "start_angle": (0, TURN - 1),
    "stop_angle": (0, TURN - 1),
    "num_steps": (1, 10),
    "delay": (0, 100),
    "device_id": (1, 254),
}


def out_of_range(message: Message) -> str:
    """The first field that the device does not take, in words, or the empty string."""
    for field in dataclasses.fields(message):
        low, high = LIMITS.get(field.name, (0, 0xFFFF))
        value = getattr(message, field.name)
        if isinstance(value, int) and not low <= value <= high:
            name = field.name.replace("_", " ").capitalize()
            return f"{name} out of range: {low} to {high}, got {value}"
    return ""
