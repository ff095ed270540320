"""The two kinds of sonar behind a device: a fan that looks ahead, and one beam on a head that turns."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sonar_component.devices.echoes import PingOrder
from sonar_component.echo.beams import equal_angle
from sonar_component.samples import RigidBodyState, Sonar
from sonar_component.scene.world import World
from sonar_component.sonars.forward_looking import ForwardLookingSonar
from sonar_component.sonars.imager import FanImager
from sonar_component.sonars.receiver import with_gain
from sonar_component.sonars.settings import ForwardLookingSettings, SonarSettings


class FanOfBeams:
    """A forward-looking sonar."""

    def __init__(self, context: Any, settings: ForwardLookingSettings) -> None:
        self._sonar = ForwardLookingSonar(context, settings)
        self._rng = np.random.default_rng(settings.seed)

    def ping(self, order: PingOrder, world: World, pose: RigidBodyState) -> Sonar:
        """Render one ping; settings that are the same object as before cost nothing."""
        settings = order.settings
        assert isinstance(settings, ForwardLookingSettings)
        if settings is not self._sonar.settings:
            self._sonar.settings = settings
        return self._sonar.ping(world, pose, self._rng if settings.enable_speckle_noise else None)

    def release(self) -> None:
        """Give GPU memory back."""
        self._sonar.release()


class TurningBeam:
    """A scanning sonar: one beam, ``bearing`` to the left of the sonar's X."""

    def __init__(self, context: Any, settings: SonarSettings) -> None:
        self._settings = settings
        self._imager = FanImager(context, settings, equal_angle(1, settings.beam_width, settings.beam_height))

    def ping(self, order: PingOrder, world: World, pose: RigidBodyState) -> Sonar:
        """Render one ping; settings that are the same object as before cost nothing."""
        s = order.settings
        if s is not self._settings:
            self._imager.adopt(s, equal_angle(1, s.beam_width, s.beam_height))
            self._settings = s
        bins = with_gain(self._imager.echoes(world, pose.transform() @ turned_left(order.bearing)), s.gain)
        return Sonar(
            time=pose.time, bin_duration=s.range / s.bin_count / s.speed_of_sound, beam_width=s.beam_width,
            beam_height=s.beam_height, bearings=np.array([order.bearing]), speed_of_sound=s.speed_of_sound,
            bin_count=s.bin_count, beam_count=1, bins=bins, frame=s.frame,
            sensor_position=np.array(pose.position), sensor_orientation=np.array(pose.orientation),
        )  # fmt: skip

    def release(self) -> None:
        """Give GPU memory back."""
        self._imager.release()


def turned_left(bearing: float) -> NDArray[np.float64]:
    """X_SH, (4, 4): pose of a head H that looks ``bearing`` [rad] to the left of the sonar's X."""
    X_SH = np.eye(4)
    c, s = np.cos(bearing), np.sin(bearing)
    X_SH[:2, :2] = [[c, -s], [s, c]]
    return X_SH
