"""The world that a sonar looks at: bodies with poses, meshes, materials, and the readers that make them from files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from sonar_component.scene.body import Body, Part
from sonar_component.scene.material import Material
from sonar_component.scene.mesh import Mesh
from sonar_component.scene.world import World

__all__ = ["Body", "Material", "Mesh", "Part", "World", "load_world"]


def load_world(path: str | Path, search_path: Sequence[str | Path] = ()) -> World:
    """Read a scene YAML, an SDF world or model, or a bare mesh file; see `scene.loading.load_world`."""
    from sonar_component.scene.loading import load_world as read  # trimesh takes half a second, which not all need

    return read(path, search_path)
