"""SceneTask: holds the world and tells it to every sonar, also to those in other processes and on other hosts.

What changes seldom (a body comes or goes, a material) is an operation and tells the whole world again; what flows (the
poses of bodies) comes on a port and goes out as poses alone. Both are latched: whoever comes later hears the last one.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import Field

from sonar_component.middleware.operations import operation
from sonar_component.middleware.ports import InputPort, OutputPort
from sonar_component.middleware.task import NoProperties, PortDriven, Task
from sonar_component.samples.rigid_body_state import RigidBodyState
from sonar_component.samples.scene_description import BodyPoses, SceneDescription
from sonar_component.settings.errors import SettingsError
from sonar_component.settings.paths import find_file

if TYPE_CHECKING:
    from sonar_component.scene import World

REFUSED_POSES = "REFUSED_POSES"
_MOST_NAMES = 100  # [-], of bodies that are not there, counted apart: a writer that makes up names must not fill memory
_OTHERS = "(others)"


class SceneProperties(NoProperties):
    """What can be set."""

    world: str = Field(description="scene YAML, SDF world or model, or mesh file")
    search_path: list[str] = Field([], description="folders for model:// of SDF, before those of SDF_PATH and its like")


class SceneTask(Task):
    """Loads a world, publishes it once for everybody who comes, and changes it as told."""

    Properties = SceneProperties
    activity = PortDriven(("pose_cmd",))

    pose_cmd: InputPort[RigidBodyState] = InputPort(RigidBodyState, doc="Poses of bodies, named by sourceFrame.")
    scene: OutputPort[SceneDescription] = OutputPort(SceneDescription, queue=2, doc="The whole world; latched.")
    body_poses: OutputPort[BodyPoses] = OutputPort(BodyPoses, doc="Where its bodies are; latched.")

    world: World

    @classmethod
    def check(cls, properties: Any, beside: str | Path | None) -> list[tuple[str, str]]:
        """File and folders must be there."""
        refs = [("world", properties.world), *(("search_path", folder) for folder in properties.search_path)]
        return [(name, reason) for name, ref in refs if (reason := _missing(ref, beside))]

    def configure_hook(self) -> bool | None:
        """Load the world."""
        from sonar_component.scene import load_world  # trimesh takes most of a second; `sonar check` has no use for it

        try:
            self._file = self.find_file(self.properties.world)
            self._search_path = [self.find_file(folder) for folder in self.properties.search_path]
            self.world = load_world(self._file, self._search_path)
        except SettingsError as error:
            return self.refuse(str(error))
        self._warned: set[str] = set()
        self._warn()
        return True

    def start_hook(self) -> bool | None:
        """Tell the world."""
        self._refused: Counter[str] = Counter()
        self._tell()
        return True

    def update_hook(self) -> None:
        """Move bodies; a pose for a body that is not there is refused by name."""
        times = []
        while (pose := self.pose_cmd.read_new()) is not None:
            if self._moved(pose):
                times.append(pose.time or self.now())
        if times:
            self.body_poses.write(self.world.body_poses(max(times)))

    @operation
    def spawn(self, name: str, body: dict[str, Any]) -> str:
        """Put a body into the world, described as in a scene YAML; returns the world's new content hash."""
        from sonar_component.scene.changes import make_body

        self.world.add(make_body(self.world, name, body, self._file, self._search_path))
        return self._changed_world()

    @operation
    def remove(self, name: str) -> str:
        """Take a body out of the world; returns the world's new content hash."""
        self.world.remove(name)
        return self._changed_world()

    @operation
    def set_material(self, body: str, material: str | dict[str, Any], part: str | None = None) -> str:
        """Give a body, or its parts of that name, a material of the world by name or as in a scene YAML."""
        from sonar_component.scene.changes import make_material

        self.world.set_material(body, make_material(self.world, body, material, self._file), part)
        return self._changed_world()

    @operation
    def bodies(self) -> dict[str, Any]:
        """Names of all bodies with position [m], whether they move, names of their parts and materials."""
        return {
            name: {
                "position": body.X_WB[:3, 3].tolist(),
                "moving": body.moving,
                "parts": sorted({part.name for part in body.parts}),
                "materials": {part.material.name: part.material.reflectance for part in body.parts},
            }
            for name, body in self.world.bodies.items()
        }

    @operation
    def refused_poses(self) -> dict[str, int]:
        """How many poses came for each body that is not in the world, since the start."""
        return dict(self._refused)

    def _changed_world(self) -> str:
        self._warn()
        if self.lifecycle.running:
            self._tell()
        return self.world.content_hash()

    def _tell(self) -> None:
        now = self.now()
        self.scene.write(self.world.to_description(now))
        self.body_poses.write(self.world.body_poses(now))

    def _warn(self) -> None:
        for line in self.world.warnings:
            if line not in self._warned:
                self.log.warning("%s", line)
        self._warned.update(self.world.warnings)

    def _moved(self, pose: RigidBodyState) -> bool:
        try:
            self.world.set_pose(pose.sourceFrame, pose.transform())
        except ValueError as error:
            self._refuse_pose(pose.sourceFrame, str(error))
            return False
        return True

    def _refuse_pose(self, name: str, reason: str) -> None:
        """Count by name; said once for each, since poses come many times a second."""
        if name not in self._refused:
            name = name if len(self._refused) < _MOST_NAMES else _OTHERS
        if name not in self._refused:
            self.log.warning("%s: pose refused: %s", self.pose_cmd.full_name, reason)
        self._refused[name] += 1
        names = ", ".join(f"'{name}'" for name in self._refused)
        self.note(REFUSED_POSES, f"poses came for {names}: the operation refused_poses counts them")


def _missing(ref: str, beside: str | Path | None) -> str:
    try:
        find_file(ref, beside)
    except SettingsError as error:
        return str(error)
    return ""
