"""SceneTask: holds the world and tells it to every sonar, also to those in other processes and on other hosts."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import Field

from sonar_component.middleware.ports import InputPort, OutputPort
from sonar_component.middleware.task import NoProperties, PortDriven, Task
from sonar_component.samples.rigid_body_state import RigidBodyState
from sonar_component.samples.scene_description import BodyPoses, SceneDescription
from sonar_component.settings.errors import SettingsError
from sonar_component.settings.paths import find_file

if TYPE_CHECKING:
    from sonar_component.scene import World


class SceneProperties(NoProperties):
    """What can be set."""

    world: str = Field(description="scene YAML, SDF world or mesh file")


class SceneTask(Task):
    """Loads a world, publishes it once for everybody who comes, and moves its bodies as told."""

    Properties = SceneProperties
    activity = PortDriven(("pose_cmd",))

    pose_cmd: InputPort[RigidBodyState] = InputPort(RigidBodyState, doc="Poses of bodies, named by sourceFrame.")
    scene: OutputPort[SceneDescription] = OutputPort(SceneDescription, queue=2, doc="The whole world; latched.")
    body_poses: OutputPort[BodyPoses] = OutputPort(BodyPoses, doc="Where its bodies are; latched.")

    world: World

    @classmethod
    def check(cls, properties: Any, beside: str | Path | None) -> list[tuple[str, str]]:
        """The file must be there."""
        try:
            find_file(properties.world, beside)
        except SettingsError as error:
            return [("world", str(error))]
        return []

    def configure_hook(self) -> bool | None:
        """Load the world."""
        from sonar_component.scene import load_world  # trimesh takes most of a second; `sonar check` has no use for it

        try:
            self.world = load_world(self.find_file(self.properties.world))
        except SettingsError as error:
            return self.refuse(str(error))
        for line in self.world.warnings:
            self.log.warning("%s", line)
        return True

    def start_hook(self) -> bool | None:
        """Tell the world."""
        now = self.now()
        self.scene.write(self.world.to_description(now))
        self.body_poses.write(self.world.body_poses(now))
        return True

    def update_hook(self) -> None:
        """Move bodies; a pose for a body that is not there is refused by name."""
        latest = 0
        while (pose := self.pose_cmd.read_new()) is not None:
            if self._moved(pose):
                latest = max(latest, pose.time)
        if latest:
            self.body_poses.write(self.world.body_poses(latest))

    def _moved(self, pose: RigidBodyState) -> bool:
        try:
            self.world.set_pose(pose.sourceFrame, pose.transform())
        except ValueError as error:
            self.log.warning("%s: %s", self.pose_cmd.full_name, error)
            return False
        return True
