"""Solids drawn up from an outline."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sonar_component.scene.mesh import Mesh
from sonar_component.scene.surface import Surface, to_mesh

Outline = NDArray[np.float64]

MAX_POINTS = 10_000  # [-], clipping ears takes time with the square of this


def extruded(outline: Outline, height: float) -> Mesh:
    """A solid over an outline (n, 2) [m] in the XY plane, from z = 0 up to `height` [m].

    Raises
    ------
    ValueError
        When the outline has less than three corners, too many, or crosses itself so that no triangle can be cut off.
    """
    if len(outline) > MAX_POINTS:
        raise ValueError(f"an outline must have at most {MAX_POINTS} points, got {len(outline)}")
    keep = np.any(outline != np.roll(outline, 1, axis=0), axis=1)  # a last point that repeats the first, and the like
    points = outline[keep]
    if len(points) < 3:
        different = len(np.unique(outline, axis=0))
        raise ValueError(f"an outline must have at least 3 different points, got {different}")
    if _area(points) < 0:
        points = points[::-1]
    n = len(points)
    cap = triangles(points)
    i = np.arange(n)
    j = (i + 1) % n
    sides = np.concatenate([np.stack([i, j, j + n], 1), np.stack([i, j + n, i + n], 1)])
    faces = np.concatenate([cap[:, ::-1], cap + n, sides])
    low = np.column_stack([points, np.zeros(n)])
    mesh, offset, _ = to_mesh(Surface("outline", np.concatenate([low, low + np.array([0, 0, height])]), faces))
    return Mesh(mesh.vertices + offset, mesh.normals, mesh.faces)


def triangles(points: Outline) -> NDArray[np.int64]:
    """Cut a simple counter-clockwise polygon (n, 2) into n - 2 triangles by clipping ears."""
    left = list(range(len(points)))
    cut = []
    while len(left) > 3:
        ear = next((k for k in range(len(left)) if _is_ear(points, left, k)), None)
        if ear is None:
            raise ValueError("an outline must not cross or touch itself")
        cut.append((left[ear - 1], left[ear], left[(ear + 1) % len(left)]))
        del left[ear]
    cut.append((left[0], left[1], left[2]))
    return np.array(cut, np.int64)


def _is_ear(points: Outline, left: list[int], k: int) -> bool:
    """Tell whether the triangle at corner k lies inside and holds no other corner."""
    a, b, c = points[left[k - 1]], points[left[k]], points[left[(k + 1) % len(left)]]
    turn = _cross(b - a, c - a)
    if turn < 0:
        return False
    others = points[[i for i in left if i not in (left[k - 1], left[k], left[(k + 1) % len(left)])]]
    inside = (_cross(b - a, others - a) > 0) & (_cross(c - b, others - b) > 0) & (_cross(a - c, others - c) > 0)
    return not bool(np.any(inside))


def _cross(u: Outline, v: Outline) -> NDArray[np.float64]:
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])


def _area(points: Outline) -> float:
    return float(_cross(points, np.roll(points, -1, axis=0)).sum() / 2)
