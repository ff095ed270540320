"""Mesh files to parts in metres with Z up: OBJ, STL, PLY, GLB/glTF and COLLADA.

Files are read as they are written: metres, Z up. Only COLLADA says its own unit and up axis, and both are honoured.
glTF is Y up by its standard, but many tools (and Gazebo's users) write Z up into it, so nothing is guessed: a warning
says so until `up: y` or `up: z` decides.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sonar_component.scene.body import Part
from sonar_component.scene.file_object import FileObject
from sonar_component.scene.mesh import Mesh
from sonar_component.scene.promise import check_whole
from sonar_component.scene.surface import Surface, to_mesh
from sonar_component.settings import SettingsError

SUFFIXES = (".obj", ".stl", ".ply", ".glb", ".gltf", ".dae")
MAX_BYTES = 256 << 20  # [B], an STL of 5 million triangles; a larger file is a mistake, or needs thinning
MAX_FACES = 8_000_000  # [-], which take about 6 GB while they are made sound

# Rotations that bring the named axis of a file up to Z.
UP = {
    "z": np.eye(3),
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "x": np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]),
}
_ROTATION_TOLERANCE = 1e-5  # [-], what products of the float32 matrices of a glTF leave
_FLOAT32_METRES = 1e4  # [m], where one float32 step is 1 mm
_FLOAT32_FILES = (".stl", ".glb", ".gltf", ".dae")


@dataclass(frozen=True)
class MeshOptions:
    """How a mesh file is to be read.

    Attributes
    ----------
    scale : (3,) factors along X, Y, Z, after unit and up axis.
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
    warnings : what was repaired or left out, by object.

    Raises
    ------
    SettingsError
        When the file is too large, broken, of an unknown kind, or holds no faces.
    """
    _check(path)
    warnings: list[str] = []
    objects, X_BF = _read(path, options or MeshOptions(), warnings)
    faces = sum(len(surface.faces) for surface in {id(o.surface): o.surface for o in objects}.values())
    if faces > MAX_FACES:
        raise SettingsError(f"has too many faces: at most {MAX_FACES}, got {faces}", str(path))
    made: dict[tuple[int, bytes], tuple[Mesh, NDArray[np.float64]] | None] = {}
    parts = []
    for found in objects:
        X, bake = split_rigid(X_BF @ found.X_FO)
        key = (id(found.surface), bake.tobytes())
        if key not in made:
            made[key] = _mesh_of(found, bake, path, warnings)
        entry = made[key]
        if entry is not None:
            X[:3, 3] += X[:3, :3] @ entry[1]
            parts.append(Part(entry[0], found.material, X, found.name))
    if not parts:
        reason = f": {warnings[0]}" if warnings else ""
        raise SettingsError(f"has no faces that a sonar can see{reason}", str(path))
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
    found: FileObject, bake: NDArray[np.float64], path: Path, warnings: list[str]
) -> tuple[Mesh, NDArray[np.float64]] | None:
    """Return the mesh of an object and its offset, or None where nothing of it is sound."""
    try:
        mesh, offset, repaired = to_mesh(_baked(found.surface, bake))
    except ValueError as error:
        warnings.append(f"{error}, left out")
        return None
    warnings.extend(repaired)
    distance = np.abs(offset).max()
    if path.suffix.lower() in _FLOAT32_FILES and distance > _FLOAT32_METRES:
        warnings.append(f"'{found.name}': lies {distance:.0f} m from its origin in a float32 file, so it is rough")
    return mesh, offset


def _baked(surface: Surface, bake: NDArray[np.float64]) -> Surface:
    if np.array_equal(bake, np.eye(3)):
        return surface
    faces = surface.faces[:, ::-1] if np.linalg.det(bake) < 0 else surface.faces
    normals = None if surface.normals is None else surface.normals @ np.linalg.pinv(bake)
    return Surface(surface.name, surface.vertices @ bake.T, faces, normals, surface.uv)


def _check(path: Path) -> None:
    if path.suffix.lower() not in SUFFIXES:
        raise SettingsError(f"is not a mesh file known here; allowed: {', '.join(SUFFIXES)}", str(path))
    try:
        size = path.stat().st_size
    except OSError as error:
        raise SettingsError(f"cannot be read: {error.strerror}", str(path)) from None
    if size > MAX_BYTES:
        raise SettingsError(f"is too large: at most {MAX_BYTES >> 20} MiB, got {size >> 20} MiB", str(path))


def _read(path: Path, options: MeshOptions, warnings: list[str]) -> tuple[list[FileObject], NDArray[np.float64]]:
    """Return the objects, and the affine matrix from the file's numbers to metres with Z up."""
    kind, unit, up = path.suffix[1:].lower(), 1.0, "z"
    try:
        check_whole(path)
        # Each reader is imported for its own files only: trimesh takes half a second, pycollada a sixth.
        if kind == "dae":
            from sonar_component.scene.collada_file import collada_objects

            objects, unit, up = collada_objects(path, warnings)
        else:
            from sonar_component.scene.trimesh_file import trimesh_objects

            objects = trimesh_objects(path, warnings)
    except MemoryError:
        raise SettingsError("needs more memory than there is", str(path)) from None
    except Exception as error:  # the readers raise whatever a broken file makes them stumble over
        reason = (str(error).strip() or type(error).__name__).splitlines()[0]
        raise SettingsError(f"is not a readable {kind.upper()} file: {reason}", str(path)) from None
    if kind in ("glb", "gltf") and options.up is None and not _as_trimesh_writes(path):
        line = "glTF is Y up by its standard but read as Z up here; `up: y` or `up: z` beside the mesh decides"
        warnings.append(line)
    X_BF = np.eye(4)
    X_BF[:3, :3] = np.diag(options.scale) @ UP[options.up or up] * (options.unit or unit)
    return objects, X_BF


def _as_trimesh_writes(path: Path) -> bool:
    """Tell whether a glTF comes from trimesh, which writes coordinates as they are; other tools may turn them Y up."""
    with path.open("rb") as file:
        return b"mikedh/trimesh" in file.read(1 << 16)
