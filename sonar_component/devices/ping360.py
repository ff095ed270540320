"""Ping360-compatible endpoint: a scanning sonar (MSIS) for clients of the Ping protocol, over UDP and a serial line."""

from __future__ import annotations

import logging
import math
from functools import partial

from pydantic import Field, field_validator, model_validator

from sonar_component.devices.endpoint import Address, DeviceEndpoint, EndpointProperties, opened
from sonar_component.devices.link import Arrival, Outgoing
from sonar_component.devices.ping360_discovery import DISCOVERY_PORT, answer
from sonar_component.devices.ping360_head import Ping360Head, Ping360Timing
from sonar_component.devices.pty import PtyLink
from sonar_component.devices.station import Station, Wire
from sonar_component.devices.turning import beam_maker, sonar_of
from sonar_component.devices.udp import UdpLink
from sonar_component.settings.quantity import Angle, Duration, Ratio
from sonar_component.sonars.scanning_settings import ScanningSettings
from sonar_component.sonars.settings import AttenuationProperties

_DEG = math.pi / 180


class Ping360Properties(EndpointProperties, ScanningSettings):
    """The sonar, and its wire.

    A client sets range, bin_count, gain, frequency and the way of the head; values given here do not count. The opening
    of the beam, 2 by 25 deg, is that of the product sheet.
    """

    beam_width: Angle = 2 * _DEG
    beam_height: Angle = 25 * _DEG
    accuracy: Ratio = 0.1  # the device's pace comes before the last percent of an image
    enable_attenuation: bool = True
    attenuation_properties: AttenuationProperties = AttenuationProperties(frequency=740e3, salinity=35.0)
    udp: Address = Field("127.0.0.1:12345", description="HOST:PORT to serve; empty: none")
    pty: str = Field("", description="name of a serial line to make; empty: none")
    discovery: Address = Field(f"127.0.0.1:{DISCOVERY_PORT}", description="HOST:PORT of discovery by UDP; empty: none")
    overhead: Duration = Field(20e-3, ge=0, le=1, description="of each ping, beside its samples")
    motor_step: Angle = 0.9 * _DEG
    motor_step_time: Duration = Field(6e-3, ge=0, le=0.1, description="of each gradian that the motor goes beyond one")
    firmware: str = Field("3.3.8", description="version to report; clients scan by themselves up to 3.3.0")
    device_id: int = Field(2, ge=1, le=254)
    zero_bearing: Angle = Field(math.pi, ge=-math.pi, le=math.pi, description="where angle 0 looks, left positive")

    @classmethod
    def addresses(cls) -> tuple[str, ...]:
        """Properties that are addresses."""
        return ("udp", "discovery")

    @field_validator("firmware")
    @classmethod
    def _is_a_version(cls, text: str) -> str:
        parts = text.split(".")
        if len(parts) != 3 or not all(p.isascii() and p.isdigit() and int(p) < 256 for p in parts):
            raise ValueError(f"must be three numbers of 0 to 255 with dots, such as 3.3.8, got {text!r}")
        return text

    @model_validator(mode="after")
    def _has_a_wire(self) -> Ping360Properties:
        if not (self.udp or self.pty):
            raise ValueError("udp or pty must be given: there is no other wire to the device")
        return self


class Ping360Endpoint(DeviceEndpoint):
    """Scanning sonar (MSIS) on its own wire."""

    Properties = Ping360Properties

    def open(self) -> Station:
        """Put the device on its wires."""
        return open_ping360(self.properties, self.log)


def open_ping360(properties: Ping360Properties, log: logging.Logger) -> Station:
    """A device on its wires, not yet serving.

    Raises
    ------
    OSError
        If an address or name cannot be had.
    """
    p = properties
    major, minor, patch = (int(part) for part in p.firmware.split("."))
    timing = Ping360Timing(p.overhead, p.motor_step_time)
    head = Ping360Head(sonar_of(p), timing, (major, minor, patch), p.device_id, p.zero_bearing)
    wires: list[Wire] = []
    try:
        if p.udp:
            wires.append((opened("udp", UdpLink, p.udp), head.receive))
        if p.pty:
            wires.append((opened("pty", PtyLink, p.pty), head.receive))
    except OSError:
        for wire, _ in wires:
            wire.close()
        raise
    if p.udp and p.discovery:
        wires += _discovery(p.discovery, log)
    return Station(head, wires, beam_maker(head.settings()), log)


def _discovery(address: str, log: logging.Logger) -> list[Wire]:
    try:
        link: UdpLink = opened("discovery", UdpLink, address)
    except OSError as error:
        # One answer for a computer is enough, and clients that know the address need none.
        log.warning("%s; without discovery", error)
        return []
    return [(link, partial(_discover, link))]


def _discover(link: UdpLink, arrival: Arrival, now: float) -> list[Outgoing]:
    reply = answer(arrival.data, link.address_towards(arrival.peer.address))
    return [] if reply is None else [(arrival.peer, reply)]
