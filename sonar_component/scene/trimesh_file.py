"""OBJ, STL, PLY and glTF through trimesh, with their scene graphs, materials and texture coordinates."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from sonar_component.scene.file_object import FileObject
from sonar_component.scene.gltf_file import readable_gltf
from sonar_component.scene.material import Material
from sonar_component.scene.surface import Surface
from sonar_component.scene.texture import map_of, material_of

logging.getLogger("trimesh").setLevel(logging.CRITICAL)  # its complaints come back as our errors, with the file's name


def trimesh_objects(path: Path, warnings: list[str]) -> list[FileObject]:
    """Read all objects of a file; raises whatever the readers below stumble over in a broken one."""
    scene, scales = _load(path, warnings)
    materials: dict[int, Material] = {}
    surfaces: dict[str, Surface] = {}
    order = {name: i for i, name in enumerate(scene.geometry)}
    objects = []
    for node in sorted(scene.graph.nodes_geometry, key=lambda node: order[scene.graph[node][1]]):
        X_FO, name = scene.graph[node]
        geometry = scene.geometry[name]
        if not isinstance(geometry, trimesh.Trimesh) or len(geometry.faces) == 0:
            warnings.append(f"'{node}': holds no faces (points or lines only), left out")
            continue
        if name not in surfaces:
            surfaces[name] = _surface(name, geometry)
        material = material_of(geometry, path, materials, scales, warnings)
        # trimesh names the objects of an OBJ "object_material".
        objects.append(FileObject(str(node).removesuffix(f"_{material.name}"), X_FO, surfaces[name], material))
    return objects


def _load(path: Path, warnings: list[str]) -> tuple[Any, dict[str, float]]:
    """The scene, and scales of normal maps by material."""
    kind = path.suffix[1:].lower()
    options: dict[str, Any] = {"split_objects": True, "split_groups": True} if kind == "obj" else {}
    if kind in ("glb", "gltf"):
        source, scales, notes = readable_gltf(path)
        warnings.extend(notes)
        resolver = trimesh.resolvers.FilePathResolver(str(path))
        return trimesh.load_scene(source, process=False, file_type=kind, resolver=resolver), scales
    return trimesh.load_scene(path, process=False, **options), {}


def _surface(name: str, geometry: Any) -> Surface:
    vertices = np.asarray(geometry.vertices, np.float64)
    # Only normals that the file holds: trimesh would make its own, smooth over every edge, when asked.
    held = geometry._cache["vertex_normals"] if "vertex_normals" in geometry._cache else None
    normals = None if held is None or len(held) != len(vertices) else np.asarray(held, np.float64)
    return Surface(name, vertices, np.asarray(geometry.faces, np.int64), normals, map_of(geometry))
