"""Mesh files through trimesh: OBJ, STL, PLY, GLB/glTF, COLLADA and their scene graphs, to parts in metres with Z up.

Files are read as they are written: metres, Z up. Only COLLADA says its own unit and up axis, and both are honoured.
glTF is Y up by its standard, but many tools (and Gazebo's users) write Z up into it, so nothing is guessed: a warning
says so until `up: y` or `up: z` decides.
"""

from __future__ import annotations

import logging
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from sonar_component.scene.body import Part
from sonar_component.scene.gltf_file import readable_gltf
from sonar_component.scene.material import Material
from sonar_component.scene.mesh import Mesh
from sonar_component.scene.surface import Surface, to_mesh
from sonar_component.scene.texture import map_of, material_of
from sonar_component.settings import SettingsError

SUFFIXES = (".obj", ".stl", ".ply", ".glb", ".gltf", ".dae")
MAX_BYTES = (
    1 << 30
)  # [B], reading needs about ten times the file in memory; a larger file is a mistake, or needs thinning

# Rotations that bring the named axis of a file up to Z.
UP = {
    "z": np.eye(3),
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "x": np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]),
}
_HEAD_BYTES = 1 << 16  # [B], a COLLADA asset block stands at the top
_ROTATION_TOLERANCE = 1e-5  # [-], what products of the float32 matrices of a glTF leave

logging.getLogger("trimesh").setLevel(logging.CRITICAL)  # its complaints come back as our errors, with the file's name


@dataclass(frozen=True)
class MeshOptions:
    """How a mesh file is to be read.

    Attributes
    ----------
    scale : (3,) factors on the file's axes, after its own unit.
    unit : [m] per number in the file, or None for the file's own unit.
    up : "x", "y" or "z", or None for what the file says.
    """

    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    unit: float | None = None
    up: str | None = None


def read_mesh_file(path: Path, options: MeshOptions | None = None) -> tuple[list[Part], list[str]]:
    """Read every object of a mesh file.

    Returns
    -------
    parts : one for each object of the file's scene graph, X_BM where the graph puts it.
    warnings : what was repaired, by object.

    Raises
    ------
    SettingsError
        When the file is too large, broken, of an unknown kind, or holds no faces.
    """
    options = options or MeshOptions()
    _check(path)
    X_FM, warnings = _file_frame(path, options)
    scene = _load(path, warnings)
    parts: list[Part] = []
    made: dict[tuple[str, bytes], tuple[Mesh, NDArray[np.float64]]] = {}
    materials: dict[int, Material] = {}
    order = {name: i for i, name in enumerate(scene.geometry)}
    for node in sorted(scene.graph.nodes_geometry, key=lambda node: order[scene.graph[node][1]]):
        X_node, name = scene.graph[node]
        geometry = scene.geometry[name]
        if not isinstance(geometry, trimesh.Trimesh) or len(geometry.faces) == 0:
            warnings.append(f"'{node}': holds no faces (points or lines only), left out")
            continue
        X, bake = split_rigid(X_FM @ X_node)
        key = (name, bake.tobytes())
        if key not in made:
            made[key] = _mesh_of(name, geometry, bake, path, warnings)
        mesh, offset = made[key]
        X[:3, 3] += X[:3, :3] @ offset
        material = material_of(geometry, path, materials, warnings)
        # trimesh names the objects of an OBJ "object_material".
        parts.append(Part(mesh, material, X, str(node).removesuffix(f"_{material.name}")))
    if not parts:
        raise SettingsError("has no faces: nothing in it can be seen by a sonar", str(path))
    return parts, [f"{path.name}: {line}" for line in warnings]


def split_rigid(X: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Split an affine matrix into a rigid pose (4, 4) and what must be baked into the vertices (3, 3)."""
    A = X[:3, :3]
    rigid = np.eye(4)
    rigid[:3, 3] = X[:3, 3]
    if np.abs(A @ A.T - np.eye(3)).max() < _ROTATION_TOLERANCE and np.linalg.det(A) > 0:
        u, _, v = np.linalg.svd(A)
        # The nearest rotation; exact quarter turns stay exact.
        rigid[:3, :3] = A if np.array_equal(A, np.rint(A)) else u @ v
        return rigid, np.eye(3)
    return rigid, np.array(A)


def _mesh_of(
    name: str, geometry: Any, bake: NDArray[np.float64], path: Path, warnings: list[str]
) -> tuple[Mesh, NDArray[np.float64]]:
    try:
        mesh, offset, repaired = to_mesh(_baked(name, geometry, bake))
    except ValueError as error:
        raise SettingsError(str(error), str(path)) from None
    warnings.extend(repaired)
    if path.suffix.lower() in (".stl", ".glb", ".gltf") and np.abs(offset).max() > _FLOAT32_METRES:
        warnings.append(
            f"'{name}': lies {np.abs(offset).max():.0f} m from its origin in a float32 file, so it is rough"
        )
    return mesh, offset


_FLOAT32_METRES = 1e4  # [m], where one float32 step is 1 mm


def _baked(name: str, geometry: Any, bake: NDArray[np.float64]) -> Surface:
    vertices = np.asarray(geometry.vertices, np.float64)
    faces = np.asarray(geometry.faces, np.int64)
    # Only normals that the file holds: trimesh would make its own, smooth over every edge, when asked.
    held = geometry._cache["vertex_normals"] if "vertex_normals" in geometry._cache else None
    normals = None if held is None or len(held) != len(vertices) else np.asarray(held, np.float64)
    if not np.array_equal(bake, np.eye(3)):
        vertices = vertices @ bake.T
        if np.linalg.det(bake) < 0:
            faces = faces[:, ::-1]
        if normals is not None:
            normals = normals @ np.linalg.pinv(bake)
    return Surface(name, vertices, faces, normals, map_of(geometry))


def _check(path: Path) -> None:
    if path.suffix.lower() not in SUFFIXES:
        raise SettingsError(f"is not a mesh file known here; allowed: {', '.join(SUFFIXES)}", str(path))
    try:
        size = path.stat().st_size
    except OSError as error:
        raise SettingsError(f"cannot be read: {error.strerror}", str(path)) from None
    if size > MAX_BYTES:
        raise SettingsError(f"is too large: at most {MAX_BYTES >> 20} MiB, got {size >> 20} MiB", str(path))


def _load(path: Path, warnings: list[str]) -> Any:
    kind = path.suffix[1:].lower()
    options: dict[str, Any] = {"split_objects": True, "split_groups": True} if kind == "obj" else {}
    try:
        if kind in ("glb", "gltf"):
            source, notes = readable_gltf(path)
            warnings.extend(notes)
            options |= {"file_type": kind, "resolver": trimesh.resolvers.FilePathResolver(str(path))}
            return trimesh.load_scene(source, process=False, **options)
        return trimesh.load_scene(path, process=False, **options)
    except MemoryError:
        raise SettingsError("needs more memory than there is", str(path)) from None
    except Exception as error:  # the readers below trimesh raise whatever a broken file makes them stumble over
        reason = (str(error).strip() or type(error).__name__).splitlines()[0]
        raise SettingsError(f"is not a readable {kind.upper()} file: {reason}", str(path)) from None


def _file_frame(path: Path, options: MeshOptions) -> tuple[NDArray[np.float64], list[str]]:
    """Return the affine matrix from the file's numbers to metres with Z up."""
    unit, up, warnings = 1.0, "z", []
    if path.suffix.lower() == ".dae":
        unit, up = _collada_frame(path)
    if path.suffix.lower() in (".glb", ".gltf") and options.up is None and _made_by_others(path):
        warnings.append(
            "glTF is Y up by its standard but read as Z up here; `up: y` or `up: z` beside the mesh decides"
        )
    X_FM = np.eye(4)
    turn = UP[options.up or up] * (options.unit or unit)
    X_FM[:3, :3] = np.diag(options.scale) @ turn
    return X_FM, warnings


def _collada_frame(path: Path) -> tuple[float, str]:
    head = _head(path)
    if b"<!DOCTYPE" in head or b"<!ENTITY" in head:
        raise SettingsError("holds a document type or entities, which are not read because they can explode", str(path))
    up = re.search(rb"<up_axis>\s*([XYZ])_UP\s*</up_axis>", head)
    unit = re.search(rb"<unit\b[^>]*\bmeter\s*=\s*[\"']([^\"']+)[\"']", head)
    text = unit[1].decode("ascii", "replace") if unit else "1"
    try:
        metres = float(text)
    except ValueError:
        metres = np.nan
    if not (np.isfinite(metres) and metres > 0):
        raise SettingsError(f"its unit must be a number of metres greater than 0, got {text!r}", str(path))
    return metres, up[1].decode().lower() if up else "y"  # COLLADA 1.4.1: Y up where nothing is said


def _made_by_others(path: Path) -> bool:
    """Tell whether a glTF comes from a tool that may have turned it Y up; trimesh writes coordinates as they are."""
    return b"mikedh/trimesh" not in _head(path)


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(_HEAD_BYTES)
