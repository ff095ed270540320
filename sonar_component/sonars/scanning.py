"""One ping of a scanning sonar, from world, pose and head bearing to a one-beam sample: each step is one room."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sonar_component.echo.truth import Truth
from sonar_component.gl import Context
from sonar_component.samples import Frame, RigidBodyState, Sonar
from sonar_component.samples.motion import exponential, product
from sonar_component.scene.world import World
from sonar_component.sonars.feature_costs import FeatureCost, feature_costs
from sonar_component.sonars.imager import FanImager
from sonar_component.sonars.in_ping import moving_echoes
from sonar_component.sonars.receiver import Receiver
from sonar_component.sonars.scan_head import ScanHead, wrapped
from sonar_component.sonars.scanning_settings import ScanningSettings

_DIRECTIONS = 16  # [-], in which the scene is looked at when samples are planned: 20 ms every few hundred pings
_UP = np.array([0.0, 0.0, 1.0])  # the head's axis, in the frame of its base


class ScanningSonar:
    """Renders pings of one beam; the head moves when told to.

    Use it on the thread that made the context. Settings may be assigned, all or one of them, from the next ping on.

    Attributes
    ----------
    head : ScanHead
        Where the next ping looks.
    """

    def __init__(self, context: Context, settings: ScanningSettings | None = None) -> None:
        self._settings = settings or ScanningSettings()
        self._taken_over, own = self._settings.changes, self._settings.model_copy()
        self._imager = FanImager(context, own, own.beam_table(), self._all_round)
        self._receiver = Receiver(own)
        self.head = ScanHead(own)
        self._path = _path(own)
        self._looks_at = 0.0

    @property
    def settings(self) -> ScanningSettings:
        """Settings in force."""
        return self._settings

    @settings.setter
    def settings(self, settings: ScanningSettings) -> None:
        self._taken_over, own = settings.changes, settings.model_copy()
        self._imager.adopt(own, own.beam_table())
        self._receiver.adopt(own)
        if _path(own) != self._path:
            bearing, self.head, self._path = self.head.bearing, ScanHead(own), _path(own)
            self.head.look_at(bearing)
        self._settings = settings

    def ping(
        self,
        world: World,
        pose: RigidBodyState,
        rng: np.random.Generator | None = None,
        bearing: float | None = None,
    ) -> Sonar:
        """Render one ping where the head looks, and leave the head there.

        Parameters
        ----------
        world : World
        pose : RigidBodyState
            Of the sonar's base in the world; its time becomes the sample's.
        rng : numpy Generator, optional
            Where speckle comes from, if settings enable it; None leaves the image clean.
        bearing : float, optional
            Look there instead [rad].

        Raises
        ------
        ValueError
            If the pose is not finite or not a rotation.
        """
        pose.validate()
        self._catch_up()
        bearing = self.head.bearing if bearing is None else wrapped(bearing)
        X_WS, self._looks_at = pose.transform(), bearing
        if self._settings.in_ping_motion:
            bins = self._moving(world, self._turned(pose, bearing))
        else:
            bins = self._imager.echoes(world, X_WS @ _about_z(bearing))
        bins = self._receiver.beam(bins, X_WS, self.head.place, self.head.places, rng)
        return self._sample(bins, pose, bearing)

    def truth(self, world: World, pose: RigidBodyState, bearing: float | None = None) -> Truth:
        """What stands behind each bin of the ping from that pose."""
        pose.validate()
        self._catch_up()
        bearing = self.head.bearing if bearing is None else bearing
        self._looks_at = bearing
        return self._imager.truth(world, pose.transform() @ _about_z(bearing))

    def shader_image(self, time: int) -> Frame:
        """The samples of the last ping: see ``FanImager.shader_image``."""
        return self._imager.shader_image(time)

    def explain(self) -> list[str]:
        """What was chosen for these settings, and why, one line each."""
        return self._imager.explain()

    def feature_costs(self, world: World, pose: RigidBodyState) -> list[FeatureCost]:
        """What each feature of the image from that pose costs, measured now."""
        return feature_costs(self._imager, world, self._turned(pose, self.head.bearing).transform())

    def remarks(self, sample: Sonar) -> list[str]:
        """Why an image is black or white, in words; empty for a good one."""
        return self._imager.remarks(sample.bins)

    def release(self) -> None:
        """Give GPU memory and threads back."""
        self._imager.release()

    def _catch_up(self) -> None:
        if self._settings.changes != self._taken_over:
            self.settings = self._settings

    def _all_round(self, X_WS: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Poses of the head spread over its sector, X_WS (4, 4) among them."""
        bearings = self.head.bearings()
        chosen = bearings[:: max(1, len(bearings) // _DIRECTIONS)] - self._looks_at
        return [X_WS @ _about_z(float(turn)) for turn in np.append(chosen, 0.0)]

    def _turned(self, pose: RigidBodyState, bearing: float) -> RigidBodyState:
        """Pose of the head: the base, turned about its Z axis."""
        q_SH = exponential(bearing * _UP)
        R_HS = _about_z(bearing)[:3, :3].T
        return RigidBodyState(
            time=pose.time,
            position=pose.position,
            orientation=product(np.asarray(pose.orientation, np.float64), q_SH),
            velocity=pose.velocity,
            angular_velocity=R_HS @ pose.angular_velocity,
        )

    def _moving(self, world: World, looking: RigidBodyState) -> NDArray[np.float32]:
        s = self._settings
        return moving_echoes(
            lambda at: self._imager.echoes(world, at.transform()),
            looking, s.range, s.range / s.bin_count, s.speed_of_sound, s.beam_width,
        )  # fmt: skip

    def _sample(self, bins: NDArray[np.float32], pose: RigidBodyState, bearing: float) -> Sonar:
        s = self._settings
        return Sonar(
            time=pose.time,
            bin_duration=s.range / s.bin_count / s.speed_of_sound,
            beam_width=s.beam_width,
            beam_height=s.beam_height,
            bearings=np.array([bearing]),
            speed_of_sound=s.speed_of_sound,
            bin_count=s.bin_count,
            beam_count=1,
            bins=bins,
            frame=s.frame,
            sensor_position=np.array(pose.position, np.float64),
            sensor_orientation=np.array(pose.orientation, np.float64),
        )


def _path(settings: ScanningSettings) -> tuple[object, ...]:
    """What the head's way depends on."""
    s = settings
    return s.left_limit, s.right_limit, s.motor_step, s.continuous, s.start_bearing


def _about_z(angle: float) -> NDArray[np.float64]:
    """(4, 4) turn about Z [rad]."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0, 0.0], [s, c, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
