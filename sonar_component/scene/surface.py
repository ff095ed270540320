"""From what a file says to a Mesh that the shader can trust: finite, without slivers of no area, near its own origin.

Vertices are moved by a whole number of metres and put on a grid of one micrometre. So a mesh made at UTM coordinates
and the same mesh made at the origin become the same bits: at 4.65e6 m a float64 has errors of half a nanometre, which
the grid removes. Keeping the file's own numbers lost: the image would depend on where the harbour is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sonar_component.scene import normals as shading
from sonar_component.scene.mesh import Mesh

FARTHEST = 1e8  # [m], twice around the Earth; broken files have 1e38
GRID = 1e-6  # [m], far below the wavelength of any sonar (0.5 mm at 3 MHz)


@dataclass
class Surface:
    """Raw triangles of one object, as read.

    Attributes
    ----------
    name : for messages.
    vertices : (n, 3) [m].
    faces : (m, 3) indices.
    normals : (n, 3) or None when the file has none.
    uv : (n, 2) or None.
    """

    name: str
    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    normals: NDArray[np.float64] | None = None
    uv: NDArray[np.float64] | None = None


def to_mesh(surface: Surface, crease: float = shading.CREASE_ANGLE) -> tuple[Mesh, NDArray[np.float64], list[str]]:
    """Repair a surface and give it normals.

    Returns
    -------
    mesh : Mesh
    offset : (3,) whole metres [m] to add to the mesh's vertices to be where the file put them.
    warnings : what was dropped or mended, by the surface's name and with counts.

    Raises
    ------
    ValueError
        When no face is left.
    """
    warnings: list[str] = []
    vertices, faces = _sound_faces(surface, warnings)
    offset = np.floor((vertices[faces].min(axis=(0, 1)) + vertices[faces].max(axis=(0, 1))) / 2 + 0.5)
    vertices = np.rint((vertices - offset) / GRID) * GRID
    face_normals, double_area = shading.face_normals(vertices, faces)
    solid = double_area > 0
    if not solid.all():
        _count(warnings, surface.name, int((~solid).sum()), "face without area", "dropped")
        faces, face_normals = faces[solid], face_normals[solid]
    if len(faces) == 0:
        raise ValueError(f"'{surface.name}' has no faces with an area")
    if surface.normals is None:
        source, faces, normals = _shaded(vertices, faces, face_normals, surface.uv is not None, crease)
    else:
        source, faces = _used(faces)
        normals = _mended(surface, source, vertices, faces, face_normals, warnings)
    uv = _finite_uv(surface, source, warnings)
    mesh = Mesh(vertices[source], normals.astype(np.float32), faces.astype(np.int32), uv)
    return mesh, offset, warnings


def _sound_faces(surface: Surface, warnings: list[str]) -> tuple[NDArray[np.float64], NDArray[Any]]:
    """Return vertices with zeros for the non-finite ones, and the faces that use none of those."""
    faces = surface.faces
    inside = np.asarray(((faces >= 0) & (faces < len(surface.vertices))).all(axis=1))
    _count(warnings, surface.name, int((~inside).sum()), "face with a vertex that does not exist", "dropped")
    faces = faces[inside]
    # Also false for NaN.
    finite = np.asarray((np.abs(surface.vertices) < FARTHEST).all(axis=1))
    sound = np.asarray(finite[faces].all(axis=1))
    _count(
        warnings, surface.name, int((~sound).sum()), "face with vertices that are NaN or beyond all bounds", "dropped"
    )
    if not sound.any():
        raise ValueError(f"'{surface.name}' has no faces")
    return np.where(finite[:, None], surface.vertices, 0.0), faces[sound]


def _shaded(
    vertices: NDArray[np.float64],
    faces: NDArray[Any],
    face_normals: NDArray[np.float64],
    keep_seams: bool,
    crease: float,
) -> tuple[NDArray[Any], NDArray[Any], NDArray[np.float64]]:
    """Split vertices where creases or texture seams run, and average normals over what stays joined."""
    places = shading.weld(vertices, GRID)[faces]
    fans = shading.smooth_fans(places, face_normals, crease)
    weights = shading.corner_angles(vertices, faces)
    fan_normals = shading.averaged(fans, fans.size, face_normals, weights)
    key = fans.ravel() * (len(vertices) + 1) + faces.ravel() if keep_seams else fans.ravel()
    _, first, new_faces = np.unique(key, return_index=True, return_inverse=True)
    return faces.ravel()[first], new_faces.reshape(faces.shape), fan_normals[fans.ravel()[first]]


def _used(faces: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the vertices in use and the faces renumbered to them."""
    source, renumbered = np.unique(faces, return_inverse=True)
    return source, renumbered.reshape(faces.shape)


def _mended(
    surface: Surface,
    source: NDArray[Any],
    vertices: NDArray[np.float64],
    faces: NDArray[Any],
    face_normals: NDArray[np.float64],
    warnings: list[str],
) -> NDArray[np.float64]:
    """Return the file's normals made unit, with those that have no length replaced by the mean of their faces."""
    assert surface.normals is not None  # for the type checker; the caller asked
    normals = surface.normals[source]
    length = np.linalg.norm(np.where(np.isfinite(normals), normals, 0.0), axis=1)
    bad = (length < 1e-6) | ~np.isfinite(normals).all(axis=1)  # 1e-6: below what a float16 normal can be by mistake
    _count(warnings, surface.name, int(bad.sum()), "normal without length", "computed from its faces")
    normals = np.where(bad[:, None], 0.0, normals) / np.where(bad, 1.0, length)[:, None]
    if bad.any():
        weights = shading.corner_angles(vertices[source], faces)
        normals[bad] = shading.averaged(faces, len(source), face_normals, weights)[bad]
        flat = faces.ravel()
        still = np.linalg.norm(normals, axis=1) < 0.5  # faces back to back cancel: take any one of them
        first_face = np.zeros(len(source), np.int64)
        first_face[flat] = np.arange(len(flat)) // 3
        normals[still] = face_normals[first_face[still]]
    return np.asarray(normals)


def _finite_uv(surface: Surface, source: NDArray[Any], warnings: list[str]) -> NDArray[np.float32] | None:
    if surface.uv is None:
        return None
    uv: NDArray[np.float32] = surface.uv[source].astype(np.float32)
    bad = ~np.isfinite(uv).all(axis=1)
    _count(warnings, surface.name, int(bad.sum()), "texture coordinate that is not a number", "set to 0")
    uv[bad] = 0.0
    return uv


def _count(warnings: list[str], name: str, n: int, what: str, done: str) -> None:
    if n:
        warnings.append(f"'{name}': {n} x {what}, {done}")
