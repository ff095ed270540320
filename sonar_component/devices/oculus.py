"""Oculus-compatible endpoint: a multibeam sonar (FLS) on TCP, with its status on UDP."""

from __future__ import annotations

import logging
import math
import time
from pathlib import Path
from typing import Any, BinaryIO

from pydantic import Field

from sonar_component.devices.endpoint import Address, DeviceEndpoint, EndpointProperties, opened
from sonar_component.devices.link import Arrival, Outgoing, Peer, parse_address
from sonar_component.devices.oculus_head import Mode, Model, OculusHead
from sonar_component.devices.oculus_log import file_header, item
from sonar_component.devices.station import Station, Wire
from sonar_component.devices.tcp import TcpServer
from sonar_component.devices.udp import UdpLink
from sonar_component.samples import Sonar
from sonar_component.settings.quantity import Angle, Duration, Frequency, Length, Ratio
from sonar_component.sonars.settings import AttenuationProperties, ForwardLookingSettings

_DEG = math.pi / 180
_NOWHERE = "0.0.0.0"  # the address that means all addresses


class OculusProperties(EndpointProperties, ForwardLookingSettings):
    """The sonar, and its wire.

    A client sets range, gain, beam_count and the frequency, and with that the fan; values given here do not count.
    The two frequencies are those of the M1200d's product sheet.
    """

    bin_count: int = Field(500, ge=1, le=4096)
    accuracy: Ratio = 0.1  # the device's pace comes before the last percent of an image
    enable_attenuation: bool = True
    attenuation_properties: AttenuationProperties = AttenuationProperties(frequency=1e6, salinity=35.0)
    tcp: Address = Field("127.0.0.1:52100", min_length=1, description="HOST:PORT to serve; clients expect port 52100")
    status_to: Address = Field("127.0.0.1:52102", description="HOST:PORT to tell the status to, by UDP; empty: nobody")
    log: str = Field("", description="file for a log of all pings, .oculus version 1; empty: none")
    overhead: Duration = Field(5e-3, ge=0, le=1, description="from the last echo to the message")
    low_frequency: Frequency = Field(1.2e6, gt=0)
    low_beam_width: Angle = Field(130 * _DEG, gt=0, lt=math.pi)
    low_beam_height: Angle = Field(20 * _DEG, gt=0, lt=math.pi / 2)
    low_max_range: Length = Field(40.0, ge=1, le=500)
    high_frequency: Frequency = Field(2.1e6, gt=0)
    high_beam_width: Angle = Field(60 * _DEG, gt=0, lt=math.pi)
    high_beam_height: Angle = Field(12 * _DEG, gt=0, lt=math.pi / 2)
    high_max_range: Length = Field(10.0, ge=1, le=500)
    least_range: Length = Field(0.3, ge=0.1, le=1, description="that a client can ask for")
    device_id: int = Field(0xF001, ge=1, le=0xFFFF, description="a number that no device of the maker has")
    part_number: int = Field(1042, ge=0, le=0xFFFF, description="1032 M750d, 1042 M1200d, 1041 M370s, 2203 M3000d")

    @classmethod
    def addresses(cls) -> tuple[str, ...]:
        """Properties that are addresses."""
        return ("tcp", "status_to")

    def model(self) -> Model:
        """The device that these properties describe."""
        low = Mode(self.low_frequency, self.low_beam_width, self.low_beam_height, self.low_max_range)
        high = Mode(self.high_frequency, self.high_beam_width, self.high_beam_height, self.high_max_range)
        return Model(low, high, self.least_range, self.overhead, self.device_id, self.part_number)


class OculusEndpoint(DeviceEndpoint):
    """Multibeam sonar (FLS) on its own wire."""

    Properties = OculusProperties

    def open(self) -> Station:
        """Put the device on its wires."""
        return open_oculus(self.properties, self.log)


class Recorder:
    """Writes pings to a log as they leave.

    Raises
    ------
    OSError
        If the file cannot be written.
    """

    def __init__(self, path: str | Path) -> None:
        self._file: BinaryIO = Path(path).expanduser().open("wb")
        self._file.write(file_header(time.time()))

    def sent(self, sample: Sonar, outgoing: list[Outgoing]) -> None:
        """One ping."""
        for _, message in outgoing:
            self._file.write(item(message, time.time()))
        self._file.flush()

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def open_oculus(properties: OculusProperties, log: logging.Logger) -> Station:
    """A device on its wires, not yet serving.

    Raises
    ------
    OSError
        If an address or file cannot be had.
    """
    p = properties
    # The listener comes before the first status: clients connect at once.
    server: TcpServer = opened("tcp", TcpServer, p.tcp)
    links: list[Any] = [server]
    try:
        recorder = opened("log", Recorder, p.log) if p.log else None
        status_to, address = None, parse_address(p.tcp)[0]
        if p.status_to:
            target = parse_address(p.status_to)
            status = UdpLink(_sender_of(target[0]))
            links.append(status)
            status_to = Peer(status, target)
            address = status.address_towards(target) if address == _NOWHERE else address
    except OSError:
        for link in links:
            link.close()
        raise
    sonar = ForwardLookingSettings.model_validate(p.model_dump(include=set(ForwardLookingSettings.model_fields)))
    head = OculusHead(sonar, p.model(), status_to, address)
    wires: list[Wire] = [(server, head.receive), *((link, _deaf) for link in links[1:])]
    station = Station(head, wires, _imager(head.settings()), log)
    if recorder is not None:
        station.listen(recorder.sent, recorder.close)
    return station


def _sender_of(target: str) -> str:
    return "127.0.0.1:0" if target.startswith("127.") else f"{_NOWHERE}:0"


def _deaf(arrival: Arrival, now: float) -> list[Outgoing]:
    return []  # nobody answers a status


def _imager(settings: ForwardLookingSettings) -> Any:
    def make(context: Any) -> Any:
        from sonar_component.devices.imagers import FanOfBeams  # compilers take a second to import

        return FanOfBeams(context, settings)

    return make
