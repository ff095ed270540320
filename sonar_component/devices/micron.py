"""Micron-compatible endpoint: a scanning sonar (MSIS) for clients of SeaNet heads, on a serial line."""

from __future__ import annotations

import logging
import math

from pydantic import Field

from sonar_component.devices.endpoint import DeviceEndpoint, EndpointProperties, opened
from sonar_component.devices.micron_head import MicronHead
from sonar_component.devices.pty import PtyLink
from sonar_component.devices.station import Station
from sonar_component.devices.turning import beam_maker, sonar_of
from sonar_component.settings.quantity import Angle, Duration, Ratio
from sonar_component.sonars.scanning_settings import ScanningSettings
from sonar_component.sonars.settings import AttenuationProperties

_DEG = math.pi / 180


class MicronProperties(EndpointProperties, ScanningSettings):
    """The sonar, and its wire.

    A client sets range, bin_count, gain, frequency and the way of the head; values given here do not count. The opening
    of the beam, 3 by 35 deg, is that of the product sheet.
    """

    beam_width: Angle = 3 * _DEG
    beam_height: Angle = 35 * _DEG
    accuracy: Ratio = 0.1  # the device's pace comes before the last percent of an image
    enable_attenuation: bool = True
    attenuation_properties: AttenuationProperties = AttenuationProperties(frequency=700e3, salinity=35.0)
    pty: str = Field("micron.tty", min_length=1, description="name of the serial line to make")
    baud: int = Field(115200, ge=1200, le=4_000_000, description="of the serial line: how long a reply takes")
    overhead: Duration = Field(10e-3, ge=0, le=1, description="of each ping, beside its samples and its reply")
    turn_time: Duration = Field(4.0, ge=0, le=60, description="of the motor, for a whole turn")


class MicronEndpoint(DeviceEndpoint):
    """Scanning sonar (MSIS) on its own wire."""

    Properties = MicronProperties

    def open(self) -> Station:
        """Put the device on its wire."""
        return open_micron(self.properties, self.log)


def open_micron(properties: MicronProperties, log: logging.Logger) -> Station:
    """A device on its wire, not yet serving.

    Raises
    ------
    OSError
        If the name cannot be had.
    """
    p = properties
    head = MicronHead(sonar_of(p), p.overhead, p.baud, p.turn_time)
    return Station(head, [(opened("pty", PtyLink, p.pty), head.receive)], beam_maker(head.settings()), log)
