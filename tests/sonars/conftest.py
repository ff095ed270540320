"""What tests of sonars share: a pose, and a ping through a sonar of its own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from sonar_component.samples import Sonar
from sonar_component.scene import World
from sonar_component.sonars.forward_looking import ForwardLookingSonar
from sonar_component.sonars.settings import ForwardLookingSettings
from tests.reference.poses import pose

Ping = Callable[..., Sonar]


@pytest.fixture
def ping(context: Any) -> Ping:
    """A ping with these settings from the origin, or from where `at` says, and what is left on the GPU is nothing."""

    def ping_(scene: World, at: Any = None, **settings: Any) -> Sonar:
        sonar = ForwardLookingSonar(context, ForwardLookingSettings(**settings))
        try:
            return sonar.ping(scene, at or pose())
        finally:
            sonar.release()

    return ping_
