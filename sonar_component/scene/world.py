"""The world that a sonar looks at: bodies by name, and counters that say what changed.

A renderer compares the counters with those it saw last: `geometry_version` grows when buffers, textures or materials
are out of date, `pose_version` when only a pose is. Counters were chosen over callbacks: a renderer in another thread
asks when it is ready, and nobody has to unregister.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from difflib import get_close_matches

import numpy as np

from sonar_component.samples.scene_description import BodyPoses, SceneDescription
from sonar_component.scene import description
from sonar_component.scene.body import Body, Part, Pose, check_pose
from sonar_component.scene.box_mapping import box_mapped
from sonar_component.scene.material import Material
from sonar_component.scene.mesh import Mesh

_TEXTURE_SIZE = 1.0  # [m], of a picture on a mesh without texture coordinates

__all__ = ["Body", "Material", "Mesh", "Part", "World"]


class World:
    """Bodies by name.

    Attributes
    ----------
    bodies : name -> Body; change it through the methods only, which keep the counters.
    warnings : one line for each thing that was repaired, dropped or not understood while loading.
    geometry_version, pose_version : ints that grow on change.
    """

    def __init__(self, bodies: Iterable[Body] = (), warnings: Iterable[str] = ()) -> None:
        self.bodies: dict[str, Body] = {}
        self.warnings = list(warnings)
        self.geometry_version = 0
        self.pose_version = 0
        self._content_hash: str | None = None
        self._box_mapped: dict[Mesh, Mesh] = {}
        for body in bodies:
            self.add(body)

    def add(self, body: Body) -> None:
        """Put a body into the world; ValueError when its name is taken or a pose of it or its parts is not a pose."""
        if body.name in self.bodies:
            raise ValueError(f"the world already has a body '{body.name}'")
        body.X_WB = check_pose(body.X_WB, body.name)
        for part in body.parts:
            check_pose(part.X_BM, f"{part.name or 'a part'} of {body.name}")
        self.warnings += [line for line in _unsound(body) if line not in self.warnings]
        body.parts = [self._mapped(part) for part in body.parts]
        self.bodies[body.name] = body
        self._geometry_changed()

    def remove(self, name: str) -> None:
        """Take a body out of the world; ValueError when there is none of that name."""
        self.body(name)
        del self.bodies[name]
        self._geometry_changed()

    def body(self, name: str) -> Body:
        """Return the body of that name; ValueError that lists the names when there is none."""
        if name not in self.bodies:
            near = get_close_matches(name, self.bodies, 1)
            hint = f"did you mean '{near[0]}'?" if near else f"bodies: {', '.join(sorted(self.bodies)) or 'none'}"
            raise ValueError(f"the world has no body '{name}'; {hint}")
        return self.bodies[name]

    def set_pose(self, name: str, X_WB: Pose) -> None:
        """Move a body; ValueError for an unknown body or a matrix that is not a finite rigid pose."""
        body = self.body(name)
        body.X_WB = check_pose(X_WB, name)
        if not body.moving:
            # Renderers may have merged it with other static bodies: from now on it is one that moves.
            body.moving = True
            self.geometry_version += 1
        self.pose_version += 1

    def set_material(self, name: str, material: Material, part: str | None = None) -> None:
        """Give a body (or only its parts called `part`) another material; ValueError when nothing has that name."""
        body = self.body(name)
        chosen = [p for p in body.parts if part is None or p.name == part]
        if not chosen:
            names = ", ".join(sorted({p.name for p in body.parts}))
            raise ValueError(f"body '{name}' has no part '{part}'; parts: {names}")
        body.parts = [self._mapped(replace(p, material=material)) if p in chosen else p for p in body.parts]
        self._geometry_changed()

    def content_hash(self) -> str:
        """Return the SHA-256 of everything but the poses of bodies: equal hashes render alike at equal poses."""
        if self._content_hash is None:
            self._content_hash = description.from_bodies(list(self.bodies.values()), self.warnings, 0).content_hash
        return self._content_hash

    def to_description(self, time: int = 0) -> SceneDescription:
        """Return the world as flat arrays; `time` [us] is when the poses are true."""
        return description.from_bodies(list(self.bodies.values()), self.warnings, time)

    @classmethod
    def from_description(cls, sample: SceneDescription) -> World:
        """Return the world that `to_description` described; ValueError when the arrays contradict each other."""
        bodies, warnings = description.to_bodies(sample)
        world = cls(bodies, warnings)
        world._content_hash = sample.content_hash  # just checked; computing it again takes as long as all the rest
        return world

    def body_poses(self, time: int) -> BodyPoses:
        """Return the poses of all bodies in the order of the description; `time` [us] is when they are true."""
        return description.poses_of(list(self.bodies.values()), self.content_hash(), time)

    def apply_poses(self, sample: BodyPoses) -> None:
        """Move every body as told; ValueError when the poses belong to another world."""
        sample.validate()
        if sample.content_hash != self.content_hash() or len(sample.poses) != len(self.bodies):
            raise ValueError("these body poses belong to another scene description (content hash differs)")
        for body, X_WB in zip(self.bodies.values(), sample.poses, strict=True):
            if (X_WB != body.X_WB).any():
                self.set_pose(body.name, X_WB)

    def _mapped(self, part: Part) -> Part:
        """Return the part with texture coordinates where its material has pictures but its mesh has none."""
        pictures = part.material.normal_map is not None or part.material.reflectance_map is not None
        if not pictures or part.mesh.uv is not None:
            return part
        if part.mesh not in self._box_mapped:
            self._box_mapped[part.mesh] = box_mapped(part.mesh, _TEXTURE_SIZE)
        return replace(part, mesh=self._box_mapped[part.mesh])

    def _geometry_changed(self) -> None:
        self.geometry_version += 1
        self._content_hash = None


def _unsound(body: Body) -> list[str]:
    """Faces that a renderer leaves out; readers of files have dropped theirs, a program's own meshes come here."""
    lines = []
    for part in body.parts:
        finite = np.isfinite(part.mesh.vertices[part.mesh.faces]).all(axis=(1, 2))
        count = int(np.count_nonzero(~finite))
        if count:
            lines.append(f"'{body.name}': {count} x face with NaN or infinite vertices, left out")
    return lines
