"""Coarser versions of a terrain's patches, for what lies so far away that its bins cannot show every height.

A terrain is cut into square patches. Each has versions that skip 2, 4, 8 heights inside but keep every height on the
patch's border, so patches of different versions meet without cracks. All versions index the same vertices: one buffer
holds them. Decimation by edge collapse was the alternative: a third fewer triangles for the same error, but a new
vertex buffer for each version, cracks to be mended, and a dependency.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sonar_component.scene.mesh import Mesh
from sonar_component.scene.shapes import grid_faces

Faces = NDArray[np.int32]
Array = NDArray[np.float64]

SIDE = 24  # [-], squares along a patch: 1152 triangles, about what one draw command should hold
STRIDES = (1, 2, 4, 8)


@dataclass(frozen=True)
class Patch:
    """A square of a terrain in all its versions, finest first.

    Attributes
    ----------
    faces : per version (k, 3) int32, indices of the mesh's vertices.
    errors : per version, greatest height [m] by which it leaves the finest.
    """

    faces: tuple[Faces, ...]
    errors: tuple[float, ...]


def patches(mesh: Mesh) -> list[Patch]:
    """Cut a mesh that knows its grid into patches; an empty list for any other mesh.

    The finest versions together are the mesh's own faces.
    """
    if mesh.grid is None:
        return []
    rows, columns = mesh.grid
    heights = mesh.vertices[:, 2].reshape(rows, columns)
    made = []
    for r in _starts(rows):
        for c in _starts(columns):
            block = heights[r : r + SIDE + 1, c : c + SIDE + 1]
            made.append(_patch(block, r * columns + c, columns))
    return made


def coarsest(errors: Array, allowed: Array) -> NDArray[np.intp]:
    """Choose the coarsest version that is good enough.

    Parameters
    ----------
    errors : (n, versions), rising along each row [m]; inf where a patch has no such version.
    allowed : (n,), greatest error of each patch [m], such as half a bin, or half a cell's height at its distance.

    Returns
    -------
    (n,) index of the version.
    """
    return np.asarray((errors <= allowed[:, None]).sum(axis=1).clip(min=1) - 1)


def error_table(made: list[Patch]) -> Array:
    """Errors of all patches (n, len(STRIDES)) [m], rising along each row; inf where there is no such version."""
    table = np.full((len(made), len(STRIDES)), np.inf)
    for row, patch in zip(table, made, strict=True):
        row[: len(patch.errors)] = np.maximum.accumulate(patch.errors)
    return table


def _starts(samples: int) -> range:
    return range(0, samples - 1, SIDE)


def _patch(block: Array, first: int, columns: int) -> Patch:
    rows, width = block.shape
    faces, errors = [], []
    for stride in STRIDES:
        if stride > 1 and min(rows, width) - 1 < 3 * stride:
            break  # nothing would be left between the borders
        local, corners, weights = _version(rows, width, stride)
        faces.append((local // width * columns + local % width + first).astype(np.int32))
        drawn = (block.ravel()[corners] * weights).sum(axis=1)
        errors.append(float(np.abs(block.ravel() - drawn).max()))
    return Patch(tuple(faces), tuple(errors))


@lru_cache(maxsize=64)
def _version(rows: int, columns: int, stride: int) -> tuple[Faces, NDArray[np.intp], Array]:
    """Faces of one version of a block, and for each height of the block the triangle above it.

    Returns
    -------
    faces : (k, 3) indices into the block.
    corners, weights : (rows * columns, 3), so that the drawn height is the weighted sum of the corners' heights.
    """
    faces = grid_faces(rows, columns) if stride == 1 else _coarse(rows, columns, stride)
    x, y = (axis.ravel().astype(float) for axis in np.meshgrid(np.arange(columns), np.arange(rows)))
    a, b, c = (np.stack([x[faces[:, k]], y[faces[:, k]]], 1)[None] for k in range(3))
    p = np.stack([x, y], 1)[:, None]
    area = _cross(b - a, c - a)
    weight = np.stack([_cross(c - b, p - b), _cross(a - c, p - c), _cross(b - a, p - a)], 2) / area[..., None]
    inside = weight.min(axis=2).argmax(axis=1)
    return faces, faces[inside].astype(np.intp), weight[np.arange(len(p)), inside]


def _coarse(rows: int, columns: int, stride: int) -> Faces:
    """Faces of a block that keep its border and skip heights inside."""
    r, c = _inner(rows, stride), _inner(columns, stride)
    index = np.arange(rows * columns).reshape(rows, columns)
    inner = index[np.ix_(r, c)]
    faces: list[NDArray[Any]] = [inner.ravel()[grid_faces(len(r), len(c))]]
    # Each side joins the border to the inner rectangle; seen from inside, both run the same way.
    faces.append(_strip(index[0], np.arange(columns), inner[0], c))
    faces.append(_strip(index[-1][::-1], np.arange(columns), inner[-1][::-1], columns - 1 - c[::-1]))
    faces.append(_strip(index[:, -1], np.arange(rows), inner[:, -1], r))
    faces.append(_strip(index[::-1, 0], np.arange(rows), inner[::-1, 0], rows - 1 - r[::-1]))
    return np.concatenate(faces).astype(np.int32)


def _inner(samples: int, stride: int) -> NDArray[np.intp]:
    return np.unique(np.append(np.arange(stride, samples - stride, stride), samples - 1 - stride))


def _strip(outer: NDArray[np.intp], s: NDArray[np.intp], inner: NDArray[np.intp], t: NDArray[np.intp]) -> Faces:
    """Triangles between a border with places s and an inner line with places t, counter-clockwise."""
    faces, j = [], 0
    for i in range(len(outer) - 1):
        while j < len(inner) - 1 and t[j + 1] - s[i] < s[i] - t[j]:  # the next inner point is nearer
            faces.append((outer[i], inner[j + 1], inner[j]))
            j += 1
        faces.append((outer[i], outer[i + 1], inner[j]))
    faces += [(outer[-1], inner[k + 1], inner[k]) for k in range(j, len(inner) - 1)]
    return np.array(faces, np.int32)


def _cross(u: Array, v: Array) -> Array:
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])
