"""What tests of sonars share: a pose, and a ping through a sonar of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from sonar_component.samples import Sonar
from sonar_component.scene import World
from sonar_component.sonars.forward_looking import ForwardLookingSonar
from sonar_component.sonars.settings import ForwardLookingSettings
from tests.reference.poses import pose

Ping = Callable[..., Sonar]
Make = Callable[[ForwardLookingSettings], ForwardLookingSonar]


@pytest.fixture
def make(context: Any) -> Iterator[Make]:
    """Sonars that are released when the test ends, well or not."""
    made: list[ForwardLookingSonar] = []

    def make_(settings: ForwardLookingSettings) -> ForwardLookingSonar:
        made.append(ForwardLookingSonar(context, settings))
        return made[-1]

    yield make_
    for sonar in made:
        sonar.release()


@pytest.fixture
def ping(context: Any) -> Ping:
    """A ping with these settings from the origin, or from where `at` says, by a sonar of its own."""

    def ping_(scene: World, at: Any = None, **settings: Any) -> Sonar:
        sonar = ForwardLookingSonar(context, ForwardLookingSettings(**settings))
        try:
            return sonar.ping(scene, at or pose())
        finally:
            sonar.release()

    return ping_
