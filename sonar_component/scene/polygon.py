"""Solids drawn up from outlines in the XY plane, with holes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sonar_component.scene.mesh import Mesh
from sonar_component.scene.surface import Surface, to_mesh

Outline = NDArray[np.float64]

MAX_POINTS = 2000  # [-], of all outlines together: clipping ears takes time with the square of this


def extruded(outlines: Sequence[Outline], height: float) -> Mesh:
    """A solid over outlines, each (n, 2) [m], from z = 0 up to `height` [m].

    What lies inside an odd number of outlines is solid: one inside another is a hole, one inside a hole an island.

    Raises
    ------
    ValueError
        When an outline has less than three corners, there are too many, or it crosses itself or another one: a solid
        over it would be inside out in parts, and these parts be seen from behind.
    """
    if sum(len(outline) for outline in outlines) > MAX_POINTS:
        raise ValueError(f"outlines must have at most {MAX_POINTS} points in all")
    rings = [_ring(outline) for outline in outlines]
    _check_simple(rings)
    pieces = [_solid(filled, height) for filled in _with_holes(rings)]
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in pieces)])
    faces = np.concatenate([faces + start for (_, faces), start in zip(pieces, starts[:-1], strict=True)])
    vertices = np.concatenate([vertices for vertices, _ in pieces])
    mesh, offset, _ = to_mesh(Surface("outline", vertices, faces))
    return Mesh(mesh.vertices + offset, mesh.normals, mesh.faces)


def triangles(points: Outline) -> NDArray[np.int64]:
    """Cut a counter-clockwise polygon (n, 2) into n - 2 triangles by clipping ears; it may touch itself, not cross."""
    left = list(range(len(points)))
    cut = []
    while len(left) > 3:
        ear = next((k for k in range(len(left)) if _is_ear(points, left, k)), None)
        if ear is None:  # what is left may begin with points in a row
            ear = next((k for k in range(len(left)) if _is_flat(points, left, k)), None)
        if ear is None:
            raise ValueError("an outline must not cross itself or another one")
        cut.append((left[ear - 1], left[ear], left[(ear + 1) % len(left)]))
        del left[ear]
    cut.append((left[0], left[1], left[2]))
    return np.array(cut, np.int64)


def _ring(outline: Outline) -> Outline:
    """Return the outline without repeated points, counter-clockwise."""
    points = outline[np.any(outline != np.roll(outline, 1, axis=0), axis=1)]
    if len(points) < 3:
        different = len(np.unique(outline, axis=0))
        raise ValueError(f"an outline must have at least 3 different points, got {different}")
    return points if _area(points) > 0 else points[::-1]


def _check_simple(rings: Sequence[Outline]) -> None:
    """Raise ValueError where sides cross; to touch is allowed."""
    start = np.concatenate(rings)
    end = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])
    for a, b in zip(start, end, strict=True):
        if _crosses(a, b, start, end):
            x, y, u, v = (round(float(number), 4) for number in (*a, *b))
            raise ValueError(f"an outline must not cross itself or another one; ({x:g}, {y:g}) to ({u:g}, {v:g}) does")


def _with_holes(rings: Sequence[Outline]) -> list[list[Outline]]:
    """Sort rings into outer ones, each followed by its holes turned clockwise."""
    around = [
        [j for j, other in enumerate(rings) if j != i and _inside(ring[0], other)] for i, ring in enumerate(rings)
    ]
    filled = []
    for i, ring in enumerate(rings):
        if len(around[i]) % 2 == 0:
            own = [j for j in range(len(rings)) if i in around[j] and len(around[j]) == len(around[i]) + 1]
            filled.append([ring, *(rings[j][::-1] for j in own)])
    return filled


def _solid(rings: Sequence[Outline], height: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices and faces of a ring with holes: two caps, and a wall along every ring."""
    outline = rings[0]
    for hole in sorted(rings[1:], key=lambda ring: -float(ring[:, 0].max())):
        outline = _bridged(outline, hole, rings)
    cap = triangles(outline)
    low = np.column_stack([outline, np.zeros(len(outline))])
    vertices = [low, low + np.array([0, 0, height])]
    faces = [cap[:, ::-1], cap + len(low)]
    start = 2 * len(low)
    for ring in rings:
        n = len(ring)
        i = np.arange(n) + start
        j = np.roll(i, -1)
        foot = np.column_stack([ring, np.zeros(n)])
        vertices += [foot, foot + np.array([0, 0, height])]
        faces += [np.stack([i, j, j + n], 1), np.stack([i, j + n, i + n], 1)]
        start += 2 * n
    return np.concatenate(vertices), np.concatenate(faces)


def _bridged(outline: Outline, hole: Outline, rings: Sequence[Outline]) -> Outline:
    """Join a clockwise hole to the outline by a cut along the shortest line that crosses nothing."""
    distance = np.linalg.norm(outline[:, None] - hole[None], axis=2)
    start = np.concatenate([outline, *rings])
    end = np.concatenate([np.roll(outline, -1, axis=0), *(np.roll(ring, -1, axis=0) for ring in rings)])
    for flat in np.argsort(distance, axis=None):
        i, j = divmod(int(flat), len(hole))
        if not _crosses(outline[i], hole[j], start, end):
            around = np.concatenate([hole[j:], hole[: j + 1]])
            return np.concatenate([outline[: i + 1], around, outline[i:]])
    raise ValueError("an outline must not cross itself or another one")


def _crosses(a: Outline, b: Outline, start: Outline, end: Outline) -> bool:
    """Tell whether the open segment a-b crosses any of the segments properly."""
    side_a, side_b = _cross(end - start, a - start), _cross(end - start, b - start)
    side_s, side_e = _cross(b - a, start - a), _cross(b - a, end - a)
    return bool(np.any((side_a * side_b < 0) & (side_s * side_e < 0)))


def _is_ear(points: Outline, left: list[int], k: int) -> bool:
    """Tell whether the triangle at corner k lies inside and touches no other corner."""
    corners = (left[k - 1], left[k], left[(k + 1) % len(left)])
    a, b, c = points[list(corners)]
    if _cross(b - a, c - a) <= 0:
        return False
    others = points[[i for i in left if i not in corners]]
    touched = (_cross(b - a, others - a) >= 0) & (_cross(c - b, others - b) >= 0) & (_cross(a - c, others - c) >= 0)
    # Where a cut joins a hole, corners stand twice; a twin of this triangle's own corner is no obstacle.
    twins = np.any([np.all(others == corner, axis=1) for corner in (a, b, c)], axis=0)
    return not bool(np.any(touched & ~twins))


def _is_flat(points: Outline, left: list[int], k: int) -> bool:
    a, b, c = points[[left[k - 1], left[k], left[(k + 1) % len(left)]]]
    return bool(_cross(b - a, c - a) == 0)


def _inside(point: Outline, ring: Outline) -> bool:
    """Tell whether a point lies inside a ring: a ray along X crosses it an odd number of times."""
    a, b = ring, np.roll(ring, -1, axis=0)
    above = (a[:, 1] > point[1]) != (b[:, 1] > point[1])
    rise = np.where(above, b[:, 1] - a[:, 1], 1.0)
    x = a[:, 0] + (point[1] - a[:, 1]) / rise * (b[:, 0] - a[:, 0])
    return bool(np.count_nonzero(above & (x > point[0])) % 2)


def _cross(u: Outline, v: Outline) -> NDArray[np.float64]:
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])


def _area(points: Outline) -> float:
    return float(_cross(points, np.roll(points, -1, axis=0)).sum() / 2)
