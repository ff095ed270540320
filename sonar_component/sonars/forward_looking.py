"""One ping of a forward-looking sonar, from world and pose to a Sonar sample: each step is one room."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sonar_component.echo.truth import Truth
from sonar_component.gl import Context
from sonar_component.samples import Frame, RigidBodyState, Sonar
from sonar_component.scene.world import World
from sonar_component.sonars.feature_costs import FeatureCost, feature_costs
from sonar_component.sonars.imager import FanImager
from sonar_component.sonars.in_ping import moving_echoes
from sonar_component.sonars.receiver import Receiver
from sonar_component.sonars.settings import ForwardLookingSettings


class ForwardLookingSonar:
    """Renders pings.

    Use it on the thread that made the context. Settings may be assigned, all or one of them, from the next ping on.
    """

    def __init__(self, context: Context, settings: ForwardLookingSettings | None = None) -> None:
        self._settings = settings or ForwardLookingSettings()
        self._taken_over, own = self._settings.changes, self._settings.model_copy()
        self._imager = FanImager(context, own, own.beam_table())
        self._receiver = Receiver(own)

    @property
    def settings(self) -> ForwardLookingSettings:
        """Settings in force."""
        return self._settings

    @settings.setter
    def settings(self, settings: ForwardLookingSettings) -> None:
        self._taken_over, own = settings.changes, settings.model_copy()
        self._imager.adopt(own, own.beam_table())
        self._receiver.adopt(own)
        self._settings = settings

    def ping(self, world: World, pose: RigidBodyState, rng: np.random.Generator | None = None) -> Sonar:
        """Render one ping.

        Parameters
        ----------
        world : World
        pose : RigidBodyState
            Of the sonar in the world; its time becomes the sample's.
        rng : numpy Generator, optional
            Where speckle comes from, if the settings enable it; None leaves the image clean.

        Raises
        ------
        ValueError
            If the pose is not finite or not a rotation.
        """
        pose.validate()
        self._catch_up()
        X_WS = pose.transform()
        bins = self._moving(world, pose) if self._settings.in_ping_motion else self._imager.echoes(world, X_WS)
        return self._sample(self._receiver.fan(bins, X_WS, rng), pose)

    def truth(self, world: World, pose: RigidBodyState) -> Truth:
        """What stands behind each bin of the ping from that pose."""
        pose.validate()
        self._catch_up()
        return self._imager.truth(world, pose.transform())

    def shader_image(self, time: int) -> Frame:
        """The samples of the last ping: see ``FanImager.shader_image``."""
        return self._imager.shader_image(time)

    def explain(self) -> list[str]:
        """What was chosen for these settings, and why, one line each."""
        return self._imager.explain()

    def feature_costs(self, world: World, pose: RigidBodyState) -> list[FeatureCost]:
        """What each feature of the image from that pose costs, measured now."""
        return feature_costs(self._imager, world, pose.transform())

    def remarks(self, sample: Sonar) -> list[str]:
        """Why an image is black or white, in words; empty for a good one."""
        return self._imager.remarks(sample.bins)

    def release(self) -> None:
        """Give GPU memory and threads back."""
        self._imager.release()

    def _catch_up(self) -> None:
        if self._settings.changes != self._taken_over:
            self.settings = self._settings

    def _moving(self, world: World, pose: RigidBodyState) -> NDArray[np.float32]:
        s, beams = self._settings, self._imager.beams
        return moving_echoes(
            lambda at: self._imager.echoes(world, at.transform()),
            pose, s.range, s.range / s.bin_count, s.speed_of_sound, float((beams.left - beams.right).min()),
        )  # fmt: skip

    def _sample(self, bins: NDArray[np.float32], pose: RigidBodyState) -> Sonar:
        s = self._settings
        return Sonar(
            time=pose.time,
            bin_duration=s.range / s.bin_count / s.speed_of_sound,
            beam_width=self._imager.beams.width,
            beam_height=s.beam_height,
            bearings=self._imager.beams.bearings,
            speed_of_sound=s.speed_of_sound,
            bin_count=s.bin_count,
            beam_count=len(bins),
            bins=bins,
            frame=s.frame,
            sensor_position=np.array(pose.position, np.float64),
            sensor_orientation=np.array(pose.orientation, np.float64),
        )
