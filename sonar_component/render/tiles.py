"""Meshes cut into tiles of neighbouring triangles.

What is out of sight must not cost: a tile outside the sector or beyond the range is not drawn. Tiles are small enough
to follow the edge of a sector and large enough that one draw each is cheap.

Far terrain is drawn as it is. Coarser versions of its patches (every 2nd, 4th, 8th height inside, whole borders, chosen
by range and bin length) were built and lost. A sonar sees a floor at a few degrees: heights whose error moves the
surface by 2 % of a bin in range already changed an image by 1 %. Within a tenth of the default accuracy, the wreck
site's floor of 96 800 triangles stays as it is, and one of 1 500 000 seen over 100 m loses 15 % of its triangles and
10 % of the processor time.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TILE_FACES = 256  # [-], triangles per tile at most; 512 took 5 to 10 % more processor time on the standard scenes
_HUGE = 0.25  # [-], of the mesh's longest side: a triangle larger than this is kept apart


def split(vertices: Array, faces: NDArray[np.int32]) -> list[NDArray[np.int32]]:
    """Cut a mesh at the median of its longest side until every tile has at most TILE_FACES triangles.

    Parameters
    ----------
    vertices : (n, 3) float64 [m]
    faces : (m, 3) int32

    Returns
    -------
    list of (k,) int32
        Indices of the faces of each tile; faces with a vertex that is not finite are in none.
    """
    # A single vertex that is not a number would hide its whole tile; the world has counted such faces.
    a, b, c = faces.T
    finite: NDArray[np.bool_] = np.asarray(np.isfinite(vertices).all(axis=1))
    sound = np.flatnonzero(finite[a] & finite[b] & finite[c])
    if not len(sound):
        return []
    # Axis by axis and corner by corner: NumPy is slow along an axis of three.
    p_a, p_b, p_c = (vertices.T.take(corner[sound], axis=1) for corner in (a, b, c))
    centres = (p_a + p_b + p_c) / 3
    least, greatest = np.minimum(np.minimum(p_a, p_b), p_c), np.maximum(np.maximum(p_a, p_b), p_c)
    size = (greatest - least).max(axis=0)
    # A few huge triangles (a floor of two) would stretch the tiles of all their neighbours over everything.
    huge = size > _HUGE * (greatest.max(axis=1) - least.min(axis=1)).max()
    waiting = [np.flatnonzero(group) for group in (huge, ~huge) if group.any()]
    tiles: list[NDArray[np.int32]] = []
    while waiting:
        chosen = waiting.pop()
        if len(chosen) <= TILE_FACES:
            tiles.append(sound[chosen].astype(np.int32))
            continue
        inside = centres.take(chosen, axis=1)  # indexing would give it back turned, and slow
        longest = (inside.max(axis=1) - inside.min(axis=1)).argmax()
        order = np.argpartition(inside[longest], len(chosen) // 2)
        waiting += [chosen[order[: len(chosen) // 2]], chosen[order[len(chosen) // 2 :]]]
    return tiles


def bounding_sphere(points: Array) -> tuple[Array, float]:
    """Centre (3,) and radius [m] of a sphere around points (n, 3): that of their box, a few per cent too large."""
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    return centre, float(np.sqrt(((points - centre) ** 2).sum(axis=1).max()))
