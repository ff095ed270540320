"""The two kinds of sonar behind a device: a fan that looks ahead, and one beam on a head that turns.

Settings that are the same object as before cost nothing, so a head hands out a new object only when a client changed
something.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sonar_component.devices.echoes import PingOrder
from sonar_component.samples import RigidBodyState, Sonar
from sonar_component.scene.world import World
from sonar_component.sonars.forward_looking import ForwardLookingSonar
from sonar_component.sonars.scanning import ScanningSonar
from sonar_component.sonars.scanning_settings import ScanningSettings
from sonar_component.sonars.settings import ForwardLookingSettings


class FanOfBeams:
    """A forward-looking sonar."""

    def __init__(self, context: Any, settings: ForwardLookingSettings) -> None:
        self._sonar = ForwardLookingSonar(context, settings)
        self._rng = np.random.default_rng(settings.seed)

    def ping(self, order: PingOrder, world: World, pose: RigidBodyState) -> Sonar:
        """Render one ping."""
        settings = order.settings
        assert isinstance(settings, ForwardLookingSettings)
        if settings is not self._sonar.settings:
            self._sonar.settings = settings
        return self._sonar.ping(world, pose, self._rng)

    def release(self) -> None:
        """Give GPU memory back."""
        self._sonar.release()


class TurningBeam:
    """A scanning sonar, whose head looks where the order says."""

    def __init__(self, context: Any, settings: ScanningSettings) -> None:
        self._sonar = ScanningSonar(context, settings)
        self._rng = np.random.default_rng(settings.seed)

    def ping(self, order: PingOrder, world: World, pose: RigidBodyState) -> Sonar:
        """Render one ping."""
        settings = order.settings
        assert isinstance(settings, ScanningSettings)
        if settings is not self._sonar.settings:
            self._sonar.settings = settings
        self._sonar.head.look_at(order.bearing)
        return self._sonar.ping(world, pose, self._rng)

    def release(self) -> None:
        """Give GPU memory back."""
        self._sonar.release()
