"""CameraTask: what a camera on the vehicle sees under water, for people who look at the sonar beside it.

Off unless asked for: until ``enabled`` is set and somebody listens it has no GL context, so it takes no time from the
sonars. It belongs into a process of its own, where its drawing shares nothing with theirs but the machine.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from sonar_component.middleware.ports import InputPort, OutputPort
from sonar_component.middleware.task import NoProperties, PortDriven, Task
from sonar_component.render.water import Water
from sonar_component.samples import Frame, RigidBodyState
from sonar_component.samples.scene_description import MOST_BYTES, BodyPoses, SceneDescription
from sonar_component.scene.replica import Replica
from sonar_component.settings.quantity import Angle, Frequency, Length

if TYPE_CHECKING:
    from sonar_component.render.camera import Camera, View

PerMetre = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class CameraProperties(NoProperties):
    """What can be set."""

    enabled: bool = Field(False, description="draw at all")
    width: int = Field(640, ge=16, le=4096, description="of the picture [pixels]")
    height: int = Field(400, ge=16, le=4096, description="of the picture [pixels]")
    field_of_view: Angle = Field(float(np.radians(80.0)), gt=0.02, lt=2.8, description="from left to right edge")
    rate: Frequency = Field(5.0, gt=0, le=100.0, description="at most so many pictures a second")
    absorption: tuple[PerMetre, PerMetre, PerMetre] = Field(
        Water.absorption, description="of red, green and blue light [1/m]"
    )
    scattering: PerMetre = Field(Water.scattering, description="of light by particles [1/m]")
    surface: Length = Field(0.0, allow_inf_nan=False, description="height of the water's surface in the world")
    device: int | None = Field(None, ge=0, description="EGL device to draw on; the first by default")


class CameraTask(Task):
    """Underwater camera."""

    Properties = CameraProperties
    dynamic = frozenset(CameraProperties.model_fields) - {"device"}
    activity = PortDriven(("camera_pose_cmd",))

    camera_pose_cmd: InputPort[RigidBodyState] = InputPort(
        RigidBodyState, required=True, doc="Pose of the camera in the world; it looks along X."
    )
    scene: InputPort[SceneDescription] = InputPort(
        SceneDescription, required=True, automatic=True, max_bytes=MOST_BYTES, doc="The world to look at."
    )
    body_poses: InputPort[BodyPoses] = InputPort(BodyPoses, automatic=True, doc="Where its moving bodies are.")
    camera_samples: OutputPort[Frame] = OutputPort(Frame, queue=2, doc="Pictures, sRGB, row 0 on top.")

    def configure_hook(self) -> bool | None:
        """Nothing is opened before a picture is wanted."""
        self._context: Any = None
        self._camera: Camera | None = None
        self._replica = Replica()
        self._due = 0
        return True

    def update_hook(self) -> None:
        """Draw from the newest pose, if a picture is wanted and due."""
        world = self._replica.take(self.scene.read_new(), self.body_poses.read_new())
        pose = self.camera_pose_cmd.latest()
        if not (self.properties.enabled and self.camera_samples.connected()):
            self._close()
            return
        if pose is None or world is None or self.now() < self._due:
            return
        self._due = self.now() + round(1e6 / self.properties.rate)
        camera = self._open()
        camera.view, camera.water = self._view(), self._water()
        image = camera.draw(world, pose.transform())
        self.camera_samples.write(Frame(time=pose.time, image=image, channels="red,green,blue"))

    def cleanup_hook(self) -> None:
        """Give the GL context back."""
        self._close()

    def _open(self) -> Camera:
        from sonar_component.gl import create_context
        from sonar_component.render.camera import Camera

        if self._camera is None:
            self._context = create_context(self.properties.device)
            self._camera = Camera(self._context)
        return self._camera

    def _close(self) -> None:
        if self._camera is not None:
            self._camera.release()
            self._context.release()
            self._camera = self._context = None

    def _view(self) -> View:
        from sonar_component.render.camera import View

        p = self.properties
        return View(p.width, p.height, p.field_of_view)

    def _water(self) -> Water:
        p = self.properties
        return Water(p.absorption, p.scattering, p.surface)
