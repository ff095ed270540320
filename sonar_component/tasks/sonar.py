"""What every simulated sonar's task has: a turn at its process's GL context, the world, and a place on a vehicle."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any
from zlib import crc32

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from sonar_component.middleware.ports import InputPort, OutputPort
from sonar_component.middleware.task import PortDriven, Task
from sonar_component.samples import Frame, RigidBodyState, Sonar
from sonar_component.samples.scene_description import MOST_BYTES, BodyPoses, SceneDescription
from sonar_component.settings.errors import SettingsError
from sonar_component.tasks.mount import Mount, MountProperties, find_mount

if TYPE_CHECKING:
    from sonar_component.gl import SharedContext
    from sonar_component.scene.world import World

NO_SCENE = "NO_SCENE"


class SonarTaskProperties(BaseModel):
    """What is set on the task around a sonar; ``OWN`` names what the sonar itself does not know."""

    model_config = ConfigDict(defer_build=True)

    write_shader_image: bool = Field(False, description="write the samples behind each ping to shader_image")
    device: int | None = Field(None, ge=0, description="EGL device to draw on; the first by default")
    driver: str | None = Field(None, description="Mesa driver (GALLIUM_DRIVER), such as llvmpipe")
    vehicle: str = Field("", description="YAML file with the vehicle's mounts, such as configs/vehicles/auv.yaml")
    mount: str | MountProperties | None = Field(
        None, description="where the sonar sits: a name from the vehicle's file, or position and rpy; none: its centre"
    )

    @model_validator(mode="after")
    def _a_name_needs_a_file(self) -> SonarTaskProperties:
        if isinstance(self.mount, str) and not self.vehicle:
            raise ValueError(f"mount {self.mount!r} is a name: give the vehicle's file as vehicle")
        return self


OWN = frozenset(SonarTaskProperties.model_fields)
FIXED = frozenset({"device", "driver", "frame", "vehicle", "mount", "kind", "unverified"})  # not while configured


class SonarTask(Task):
    """Base of the sonar tasks: renders only while somebody listens."""

    activity = PortDriven(("sonar_pose_cmd",))

    sonar_pose_cmd: InputPort[RigidBodyState] = InputPort(
        RigidBodyState,
        required=True,
        automatic=True,
        doc="Pose of the vehicle in the world; of the sonar, where it has no mount.",
    )
    scene: InputPort[SceneDescription] = InputPort(
        SceneDescription, required=True, automatic=True, max_bytes=MOST_BYTES, doc="The world to look at."
    )
    body_poses: InputPort[BodyPoses] = InputPort(BodyPoses, automatic=True, doc="Where its moving bodies are.")
    sonar_samples: OutputPort[Sonar] = OutputPort(Sonar, queue=8, doc="One image per ping.")
    shader_image: OutputPort[Frame] = OutputPort(Frame, doc="Echo strength, range and bearing of each sample.")

    @classmethod
    def check(cls, properties: Any, beside: str | Path | None) -> list[tuple[str, str]]:
        """The vehicle's file must have the mount."""
        if isinstance(properties.mount, str):
            try:
                find_mount(properties.vehicle, properties.mount, beside)
            except SettingsError as error:
                return [("mount", str(error))]
        return []

    def open_gl(self) -> SharedContext | None:
        """The GL context that this process's sonars share; None after refusing where there is none."""
        from sonar_component.gl import GLUnavailableError, share_context

        try:
            return share_context(self.properties.device, self.properties.driver)
        except GLUnavailableError as error:
            self.refuse(str(error))
            return None

    def begin(self) -> str:
        """Take what belongs to the task from its properties; returns why that cannot be, or the empty string."""
        from sonar_component.scene.replica import Replica  # `sonar check` has no use for worlds

        p = self.properties
        self._replica, self._mount = Replica(), None
        for line in p.doubts():
            self.log.info("%s", line)  # for whoever asks: as a warning it frightened people who had set nothing
        try:
            if isinstance(p.mount, str):
                self._mount = Mount(find_mount(p.vehicle, p.mount, self.beside), p.frame)
            elif p.mount is not None:
                self._mount = Mount(p.mount, p.frame)
        except SettingsError as error:
            return str(error)
        return ""

    def own_pose(self, pose: RigidBodyState) -> RigidBodyState:
        """Pose of the sonar for a pose of its vehicle."""
        return pose if self._mount is None else self._mount.pose(pose)

    def noise_at(self, time: int) -> np.random.Generator:
        """The generator of one ping's noise: from seed, task and data time [us] alone.

        One stream for all pings was the alternative; then an image depended on how many were drawn before it, and that
        on who had listened.
        """
        return np.random.default_rng([self.properties.seed, crc32(self.name.encode()), abs(time)])

    def settings_values(self, **changed: Any) -> dict[str, Any]:
        """Properties that belong to the sonar itself."""
        values: dict[str, Any] = self.properties.model_dump(exclude=set(OWN))
        return values | changed

    def take_scene(self) -> World | None:
        """The world as it is now; None, and a note, while none has come."""
        world = self._replica.take(self.scene.read_new(), self.body_poses.read_new())
        if world is None:
            self.note(NO_SCENE, "waits for a scene description on the port scene")
        elif self.lifecycle.substate == NO_SCENE:
            self.note("")  # also where nobody listens yet
        return world

    def wanted(self) -> bool:
        """Whether anybody listens."""
        return self.sonar_samples.connected() or self.shader_image.connected()
