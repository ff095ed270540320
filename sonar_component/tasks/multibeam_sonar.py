"""MultibeamSonarTask: a forward-looking sonar that pings the scene from each new pose.

Names are those of Rock's imaging_sonar_simulation. It renders only while somebody listens, and stamps its samples with
the time of the pose.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from pydantic import Field

from sonar_component.middleware.ports import InputPort, OutputPort
from sonar_component.middleware.task import PortDriven, Task
from sonar_component.samples import Frame, RigidBodyState, Sonar
from sonar_component.samples.scene_description import BodyPoses, SceneDescription
from sonar_component.scene.world import World
from sonar_component.sonars.forward_looking import ForwardLookingSonar
from sonar_component.sonars.settings import ForwardLookingSettings

NO_SCENE = "NO_SCENE"
_OWN = frozenset({"write_shader_image", "device", "driver"})


class MultibeamSonarProperties(ForwardLookingSettings):
    """Settings of the sonar, and of the task around it."""

    write_shader_image: bool = Field(False, description="write the samples behind each ping to shader_image")
    device: int | None = Field(None, ge=0, description="EGL device to draw on; the first by default")
    driver: str | None = Field(None, description="Mesa driver (GALLIUM_DRIVER), such as llvmpipe")


class MultibeamSonarTask(Task):
    """Forward-looking sonar (FLS)."""

    Properties = MultibeamSonarProperties
    dynamic = frozenset(MultibeamSonarProperties.model_fields) - {"device", "driver", "frame"}
    activity = PortDriven(("sonar_pose_cmd",))

    sonar_pose_cmd: InputPort[RigidBodyState] = InputPort(
        RigidBodyState, required=True, doc="Pose of the sonar in the world."
    )
    scene: InputPort[SceneDescription] = InputPort(
        SceneDescription, required=True, automatic=True, doc="The world to look at."
    )
    body_poses: InputPort[BodyPoses] = InputPort(BodyPoses, automatic=True, doc="Where its moving bodies are.")
    sonar_samples: OutputPort[Sonar] = OutputPort(Sonar, queue=8, doc="One image per pose.")
    shader_image: OutputPort[Frame] = OutputPort(Frame, doc="Echo strength, range and bearing of each sample.")

    def configure_hook(self) -> bool | None:
        """Open a GL context on this task's thread and compile nothing yet: that depends on the scene."""
        from sonar_component.gl import GLUnavailableError, create_context

        try:
            context = create_context(self.properties.device, self.properties.driver)
        except GLUnavailableError as error:
            return self.refuse(str(error))
        self._context = context
        self._sonar = ForwardLookingSonar(context, self._settings())
        self._rng = np.random.default_rng(self.properties.seed)
        self._world: World | None = None
        return True

    def update_hook(self) -> None:
        """Ping from the newest pose."""
        self._take_scene()
        pose = self.sonar_pose_cmd.read_new()
        if pose is None or not (self.sonar_samples.connected() or self.shader_image.connected()):
            return
        if self._world is None:
            self.note(NO_SCENE, "waits for a scene description on the port scene")
            return
        rng = self._rng if self.properties.enable_speckle_noise else None
        sample = self._sonar.ping(self._world, pose, rng)
        self.sonar_samples.write(sample)
        if self.properties.write_shader_image and self.shader_image.connected():
            self.shader_image.write(self._sonar.shader_image(pose.time))
        self.note("", "; ".join(self._sonar.remarks(sample)))

    def cleanup_hook(self) -> None:
        """Give the GL context back."""
        self._sonar.release()
        self._context.release()

    def property_hook(self, name: str, value: Any) -> None:
        """Take a changed property into force from the next ping on."""
        if name not in _OWN:
            self._sonar.settings = self._settings(**{name: value})

    def _settings(self, **changed: Any) -> ForwardLookingSettings:
        values = self.properties.model_dump(exclude=set(_OWN)) | changed
        return ForwardLookingSettings.model_validate(values)

    def _take_scene(self) -> None:
        description = self.scene.read_new()
        if description is not None:
            self._world = World.from_description(description)
            for warning in self._world.warnings:
                self.log.warning("scene: %s", warning)
        poses = self.body_poses.read_new()
        if poses is not None and self._world is not None:
            self._world.apply_poses(poses)
