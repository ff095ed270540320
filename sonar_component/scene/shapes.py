"""Closed-form shapes as triangles with exact normals: what SDF and the scene YAML can name without a mesh file.

Curved shapes are tessellated so finely that their chord leaves the true surface by less than `deviation`. All shapes
are centred on their frame and stand along Z, as in SDF.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sonar_component.scene.mesh import Mesh

Profile = NDArray[np.float64]

DEVIATION = 0.002  # [m], a tenth of the range bin of a sonar with 500 bins over 10 m
_LEAST_SIDES, _MOST_SIDES = 24, 256  # [-], round enough for a small part; no gain beyond for a large one


def box(size: tuple[float, float, float]) -> Mesh:
    """A box with edges of the given lengths [m]; its texture covers each side once."""
    unit = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float64)
    vertices, normals = [], []
    for axis in range(3):
        for side in (1.0, -1.0):
            corners = np.empty((4, 3))
            corners[:, axis] = side
            # The next two axes keep the winding right-handed; the far side is mirrored.
            corners[:, (axis + 1) % 3], corners[:, (axis + 2) % 3] = unit[:, 0] * side, unit[:, 1]
            vertices.append(corners * np.asarray(size) / 2)
            normals.append(np.tile(np.eye(3)[axis] * side, (4, 1)))
    return _quads(np.concatenate(vertices), np.concatenate(normals))


def plane(size: tuple[float, float], normal: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> Mesh:
    """A rectangle [m] around the origin that faces along `normal`."""
    n = np.asarray(normal, np.float64) / np.linalg.norm(normal)
    x = np.array([1.0, 0.0, 0.0]) if abs(n[0]) < 0.9 else np.array([0.0, 1.0, 0.0])  # any axis well off the normal
    x = x - n * (n @ x)
    x /= np.linalg.norm(x)
    y = np.cross(n, x)
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float64) / 2
    vertices = np.outer(corners[:, 0] * size[0], x) + np.outer(corners[:, 1] * size[1], y)
    return _quads(vertices, np.tile(n, (4, 1)))


def sphere(radius: float, deviation: float = DEVIATION) -> Mesh:
    """A sphere of the given radius [m]."""
    return ellipsoid((radius, radius, radius), deviation)


def ellipsoid(radii: tuple[float, float, float], deviation: float = DEVIATION) -> Mesh:
    """An ellipsoid with the given half axes [m]."""
    sides = _sides(max(radii), deviation)
    elevation = np.linspace(-np.pi / 2, np.pi / 2, sides // 2 + 1)
    ball = _turned(np.stack([np.cos(elevation), np.sin(elevation)], 1), None, sides)
    vertices = ball.vertices * np.asarray(radii)
    normals = ball.normals / np.asarray(radii, np.float64)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Mesh(vertices, normals.astype(np.float32), ball.faces, ball.uv)


def cylinder(radius: float, length: float, deviation: float = DEVIATION) -> Mesh:
    """A closed cylinder of the given radius and length along Z [m]."""
    h = length / 2
    profile = np.array([[0, -h], [radius, -h], [radius, -h], [radius, h], [radius, h], [0, h]], np.float64)
    normals = np.array([[0, -1], [0, -1], [1, 0], [1, 0], [0, 1], [0, 1]], np.float64)
    return _turned(profile, normals, _sides(radius, deviation))


def capsule(radius: float, length: float, deviation: float = DEVIATION) -> Mesh:
    """A cylinder of the given radius and length along Z [m] with a half sphere on each end, as SDF has it."""
    sides = _sides(radius, deviation)
    elevation = np.linspace(0, np.pi / 2, sides // 4 + 1)
    cap = np.stack([np.cos(elevation), np.sin(elevation)], 1)
    normals = np.concatenate([cap[::-1] * (1, -1), cap])
    shift = np.repeat([[0.0, -length / 2], [0.0, length / 2]], len(cap), axis=0)
    return _turned(normals * radius + shift, normals, sides)


def _sides(radius: float, deviation: float) -> int:
    """Number of sides, a multiple of four, whose chord leaves the circle by less than `deviation`."""
    half_angle = np.arccos(1 - min(deviation / radius, 1.0))
    return int(np.clip(4 * np.ceil(np.pi / half_angle / 4), _LEAST_SIDES, _MOST_SIDES))


def _turned(profile: Profile, normals: Profile | None, sides: int) -> Mesh:
    """Turn a profile of (radius, z) from below to above around Z; without normals it is a unit circle."""
    normals = profile if normals is None else normals
    angle = np.linspace(0, 2 * np.pi, sides + 1)
    angle[-1] = 0.0  # the seam closes exactly
    ring = np.stack([np.cos(angle), np.sin(angle)], 1)
    vertices, normal_rows = (
        np.concatenate([p[:, None, :1] * ring[None], np.broadcast_to(p[:, None, 1:], (len(p), sides + 1, 1))], axis=2)
        for p in (profile, normals)
    )
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(profile, axis=0), axis=1))])
    u, v = np.meshgrid(np.linspace(0, 1, sides + 1), length / length[-1])
    faces = grid_faces(len(profile), sides + 1)
    rows = vertices.reshape(-1, 3)
    a, b, c = (rows[faces[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    # Poles and doubled profile points make faces without area.
    faces = faces[area > 1e-12 * area.max()]
    uv = np.stack([u.ravel(), v.ravel()], 1)
    return Mesh(rows, normal_rows.reshape(-1, 3).astype(np.float32), faces, uv.astype(np.float32))


def grid_faces(rows: int, columns: int) -> NDArray[np.int32]:
    """Faces of a grid of vertices numbered row by row; seen from where rows grow up and columns to the right, front."""
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    right, above, across = first + 1, first + columns, first + columns + 1
    faces = np.stack([first, right, across, first, across, above], 1).reshape(-1, 3)
    return faces.astype(np.int32)


def _quads(vertices: NDArray[np.float64], normals: NDArray[np.float64]) -> Mesh:
    """Four corners per side, counter-clockwise from the outside."""
    first = np.arange(0, len(vertices), 4)[:, None]
    faces = (first + np.array([0, 1, 2, 0, 2, 3])).reshape(-1, 3)
    uv = np.tile(np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32), (len(vertices) // 4, 1))
    return Mesh(vertices, normals.astype(np.float32), faces.astype(np.int32), uv)
