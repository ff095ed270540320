"""Vertex normals for files that have none: smooth over a hull plate, sharp at its edge.

Faces around a vertex form fans, cut where two neighbours meet at more than the crease angle; each fan gets one normal,
the average of its faces weighed by their angle at the vertex. Smoothing everything was the alternative that lost: it
makes a box echo like a ball. Flat everywhere lost too: a pipe of twelve sides would glint in twelve stripes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Vectors = NDArray[np.float64]
Indices = NDArray[np.int64]

CREASE_ANGLE = np.radians(
    40.0
)  # [rad], rounds a pipe of ten sides (36 deg), keeps one of eight (45 deg) and a box sharp


def face_normals(vertices: Vectors, faces: NDArray[np.int32]) -> tuple[Vectors, Vectors]:
    """Return the unit normal (m, 3) and double area (m,) [m^2] of each face; without area the normal is zero."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    n = np.cross(b - a, c - a)
    double_area = np.sqrt(np.einsum("ij,ij->i", n, n))
    return n / np.where(double_area > 0, double_area, 1.0)[:, None], double_area


def weld(points: Vectors, resolution: float) -> Indices:
    """Return, for each point (n, 3), the number of its place; points in the same cell of `resolution` [m] share one."""
    cells = np.rint(points / resolution).astype(np.int64).astype(np.uint64)
    # One 64-bit key per cell sorts ten times faster than rows of three; the odd multipliers are those of splitmix64.
    with np.errstate(over="ignore"):
        key = cells[:, 0] * np.uint64(0x9E3779B97F4A7C15)
        key ^= (cells[:, 1] + (key >> np.uint64(29))) * np.uint64(0xBF58476D1CE4E5B9)
        key ^= (cells[:, 2] + (key >> np.uint64(31))) * np.uint64(0x94D049BB133111EB)
    _, first, place = np.unique(key, return_index=True, return_inverse=True)
    if np.array_equal(cells[first[place]], cells):
        return np.asarray(place, dtype=np.int64).ravel()
    rows = np.unique(cells, axis=0, return_inverse=True)[1]  # two cells with the same key: sort the slow way
    return np.asarray(rows, dtype=np.int64).ravel()


def smooth_fans(places: Indices, normals: Vectors, crease: float) -> Indices:
    """Number the fan of every corner.

    Parameters
    ----------
    places : (m, 3), welded place of each corner of each face.
    normals : (m, 3) unit face normals.
    crease : [rad], neighbours that meet at more than this belong to different fans.

    Returns
    -------
    fans : (m, 3), equal for corners that share a normal.
    """
    m = len(places)
    corner = np.arange(3 * m).reshape(m, 3)
    start, end = places.ravel(), places[:, [1, 2, 0]].ravel()
    low, high = np.minimum(start, end), np.maximum(start, end)
    edge = low * (int(places.max()) + 1) + high
    order = np.argsort(edge, kind="stable")
    same = edge[order[1:]] == edge[order[:-1]]
    e, f = order[:-1][same], order[1:][same]  # half edge number = 3 * face + first corner
    # Faces wound against each other count as a crease: averaged, they would cancel to no normal at all.
    smooth = np.einsum("ij,ij->i", normals[e // 3], normals[f // 3]) >= np.cos(crease)
    e, f = e[smooth], f[smooth]
    following = corner[:, [1, 2, 0]].ravel()
    same_way = start[e] == start[f]
    pairs_a = np.concatenate([e, following[e]])
    pairs_b = np.concatenate([np.where(same_way, f, following[f]), np.where(same_way, following[f], f)])
    return connected(3 * m, pairs_a, pairs_b).reshape(m, 3)


def connected(n: int, a: Indices, b: Indices) -> Indices:
    """Label the connected parts of a graph of n nodes with edges a-b by their lowest node."""
    label = np.arange(n)
    while len(a):
        low = np.minimum(label[a], label[b])
        np.minimum.at(label, label[a], low)
        np.minimum.at(label, label[b], low)
        while True:  # each node jumps to the label of its label until nothing moves
            jumped = label[label]
            if np.array_equal(jumped, label):
                break
            label = jumped
        open_edges = label[a] != label[b]
        a, b = a[open_edges], b[open_edges]
    return label


def corner_angles(vertices: Vectors, faces: NDArray[np.int32]) -> Vectors:
    """Return the angle at each corner, (m, 3) [rad]."""
    p = vertices[faces]
    edge = p[:, [1, 2, 0]] - p
    length = np.linalg.norm(edge, axis=2, keepdims=True)
    edge = edge / np.where(length > 0, length, 1.0)
    cosine = -np.einsum("ijk,ijk->ij", edge, edge[:, [2, 0, 1]])
    return np.asarray(np.arccos(np.clip(cosine, -1.0, 1.0)))


def averaged(groups: Indices, count: int, normals: Vectors, weights: Vectors) -> Vectors:
    """Return the unit mean (count, 3) of the face normals over the corners of each group (m, 3), weighed (m, 3)."""
    total = np.stack(
        [np.bincount(groups.ravel(), (weights * normals[:, k : k + 1]).ravel(), count) for k in range(3)], axis=1
    )
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.asarray(total / np.where(length > 0, length, 1.0))
