"""The sonar of an endpoint with a turning head, among its properties and on the GPU."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from sonar_component.devices.echoes import Imager
from sonar_component.sonars.scanning_settings import ScanningSettings


def sonar_of(properties: ScanningSettings) -> ScanningSettings:
    """The sonar's own settings among the properties of an endpoint.

    The way of the head is the device's: it turns for ever as far as the sonar is concerned.
    """
    values = properties.model_dump(include=set(ScanningSettings.model_fields)) | {"continuous": True}
    return ScanningSettings.model_validate(values)


def beam_maker(settings: ScanningSettings) -> Callable[[Any], Imager]:
    """What makes the sonar once there is a GL context."""

    def make(context: Any) -> Imager:
        from sonar_component.devices.imagers import TurningBeam  # compilers take a second to import

        return TurningBeam(context, settings)

    return make
