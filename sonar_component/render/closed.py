"""Closed shells: surfaces whose triangles seen from behind need not be drawn, since others hide them.

Half of the triangles of a ball or a hull face away from the sonar, and on a software driver each costs as much as one
that is seen. They are left out where they belong to a closed shell and the sonar is outside it. Open surfaces (a floor,
a sail, a model with a hole) are heard from both sides and drawn whole.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_ONE_PLACE = 1e-7  # [-], of the surface's size: the pole of a ball is no point but the sines of many multiples of pi
_LARGE = 100_000  # [-], faces from which on a surface is looked at only if it is closed as a whole: most are ground
_RAYS = 64  # [-], along each side of a shell's box, from six sides
_CROSSED = 0.01  # [-], of the rays that meet a back face first: 0.1 % on sound shells, 20 % and more on crossed ones
_LEAK = 1e-6  # [-], sum of the directed areas relative to that of their sizes: a closed surface has none


@dataclass(frozen=True)
class Shells:
    """Which faces of a mesh form closed shells.

    Attributes
    ----------
    faces : (m, 3) int32
        As they were, those of closed shells wound counter-clockwise as seen from outside.
    number : (m,) int
        Of each face's shell, from 0; -1 where it is open.
    least, greatest : (shells, 3) float64
        Corners of the box around each shell [m].
    """

    faces: NDArray[np.int32]
    number: NDArray[np.intp]
    least: Array
    greatest: Array

    def hull(self, chosen: NDArray[np.int32]) -> Array:
        """(2, 3) least and greatest corner of a box around the shells of the chosen faces [m]."""
        numbers = np.unique(self.number[chosen])
        return np.stack([self.least[numbers].min(axis=0), self.greatest[numbers].max(axis=0)])


def find_shells(vertices: Array, faces: NDArray[np.int32]) -> Shells:
    """The closed shells of a mesh.

    A shell is closed if every edge of its faces is shared by two of them that run along it in opposite directions,
    corners at the same place taken as one. One that passes through itself is inside out in parts; so rays are sent to
    each, and one whose back faces are met from outside counts as open.

    Parameters
    ----------
    vertices : (n, 3) float64 [m]
    faces : (m, 3) int32
    """
    open_ = Shells(faces, np.full(len(faces), -1, np.intp), np.zeros((0, 3)), np.zeros((0, 3)))
    if not (len(faces) and np.isfinite(vertices).all()):
        return open_
    a, b, c = (vertices.T.take(corner, axis=1) for corner in faces.T)  # NumPy is slow along an axis of three
    areas = _cross(b - a, c - a)
    if len(faces) > _LARGE and _leaks(areas):
        return open_
    joined = _joined(vertices)[faces]
    sound = np.flatnonzero(~np.any(joined == np.roll(joined, 1, axis=1), axis=1))  # neither points nor lines
    label, closed = _label(joined[sound])
    if not closed.any():
        return open_
    sound = sound[closed]
    number = open_.number
    number[sound] = np.unique(label[closed], return_inverse=True)[1]
    number_of, count = number[sound], int(number.max()) + 1
    a, areas = a[:, sound], areas[:, sound]
    # Volume of a shell, about a corner of its own so that it does not drown in that of the whole.
    origin = np.zeros((3, count))
    origin[:, number_of] = a
    volume = np.bincount(number_of, ((a - origin[:, number_of]) * areas).sum(axis=0))
    inwards = sound[(volume < 0)[number_of]]
    turned = faces.copy()
    turned[inwards] = faces[inwards, ::-1]
    order = np.argsort(number_of, kind="stable")
    first = np.searchsorted(number_of[order], np.arange(count))
    corners = vertices[turned[sound[order]]]
    least = np.minimum.reduceat(corners.min(axis=1), first)
    greatest = np.maximum.reduceat(corners.max(axis=1), first)
    shells = zip(np.split(corners, first[1:]), least, greatest, strict=True)
    crossed = np.array([_crossed(*shell) > _CROSSED for shell in shells])
    number[sound[crossed[number_of]]] = -1
    return Shells(turned, number, least, greatest)


def cone(vertices: Array, faces: NDArray[np.int32]) -> tuple[Array, float]:
    """Mean direction (3,) of the normals of faces, and the greatest angle between it and one of them [rad].

    Faces without area are ignored; where the normals have no mean direction the angle is pi.
    """
    a, b, c = (vertices.T.take(corner, axis=1) for corner in faces.T)
    normals = _cross(b - a, c - a)
    sizes = np.sqrt((normals * normals).sum(axis=0))
    normals = normals[:, sizes > 0] / sizes[sizes > 0]
    axis = normals.sum(axis=1)
    length = float(np.linalg.norm(axis))
    if not length > 0:
        return np.zeros(3), np.pi
    axis /= length
    return axis, float(np.arccos(np.clip((axis @ normals).min(), -1.0, 1.0)))


def _cross(one: Array, other: Array) -> Array:
    (a, b, c), (d, e, f) = one, other
    return np.stack([b * f - c * e, c * d - a * f, a * e - b * d])


def _leaks(areas: Array) -> bool:
    return bool(np.linalg.norm(areas.sum(axis=1)) > _LEAK * np.sqrt((areas * areas).sum(axis=0)).sum())


def _joined(vertices: Array) -> NDArray[np.intp]:
    """(n,) the same number for all vertices at one place."""
    least, greatest = vertices.min(axis=0), vertices.max(axis=0)
    grid = np.rint((vertices - least) / max(_ONE_PLACE * float((greatest - least).max()), 1e-300))
    order = np.lexsort(grid.T)
    moved = np.any(np.diff(grid[order], axis=0) != 0, axis=1)
    numbers = np.empty(len(vertices), np.intp)
    numbers[order] = np.concatenate([[0], np.cumsum(moved)])
    return numbers


def _label(faces: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """For each face a number that it shares with all that it hangs together with, and whether these are closed."""
    begin, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    key = np.minimum(begin, end) * (int(faces.max(initial=0)) + 1) + np.maximum(begin, end)
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1))  # of the edges at one place
    uses = np.diff(first, append=len(order))
    one, other = order[first], order[np.minimum(first + 1, len(order) - 1)]
    good = (uses == 2) & (begin[one] == end[other])
    neighbour = np.repeat(np.arange(len(faces)), 3)
    neighbour[one[good]], neighbour[other[good]] = other[good] // 3, one[good] // 3
    neighbours = neighbour.reshape(-1, 3)
    label = np.arange(len(faces))
    while True:
        # The least number of the neighbours, and of what that one holds by then: the reach doubles with every pass.
        least = np.minimum(label, label[neighbours].min(axis=1))
        least = least[least]
        if np.array_equal(least, label):
            break
        label = least
    leaky = np.zeros(len(faces), np.bool_)
    leaky[label[(neighbours == np.arange(len(faces))[:, None]).any(axis=1)]] = True
    return label, ~leaky[label]


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def _crossed(corners: Any, least: Any, greatest: Any) -> float:
    """Share of the rays onto a shell (m, 3, 3), along all axes from both ends, that meet a face from behind first."""
    wrong = right = 0
    nearest = np.empty((2, _RAYS, _RAYS))
    facing = np.empty((2, _RAYS, _RAYS), np.int8)
    for axis in range(3):
        nearest[:] = np.inf
        facing[:] = 0
        u, v = (axis + 1) % 3, (axis + 2) % 3
        du, dv = (greatest[u] - least[u]) / _RAYS, (greatest[v] - least[v]) / _RAYS
        if not (du > 0.0 and dv > 0.0):
            continue
        for face in range(len(corners)):
            a, b, c = corners[face]
            area = (b[u] - a[u]) * (c[v] - a[v]) - (b[v] - a[v]) * (c[u] - a[u])
            if abs(area) < 1e-12 * du * dv:
                continue  # seen on edge
            first_i = max(int(np.ceil((min(a[u], b[u], c[u]) - least[u]) / du - 0.5)), 0)
            last_i = min(int(np.floor((max(a[u], b[u], c[u]) - least[u]) / du - 0.5)), _RAYS - 1)
            first_j = max(int(np.ceil((min(a[v], b[v], c[v]) - least[v]) / dv - 0.5)), 0)
            last_j = min(int(np.floor((max(a[v], b[v], c[v]) - least[v]) / dv - 0.5)), _RAYS - 1)
            for i in range(first_i, last_i + 1):
                p = least[u] + (i + 0.5) * du - a[u]
                for j in range(first_j, last_j + 1):
                    q = least[v] + (j + 0.5) * dv - a[v]
                    to_b = (p * (c[v] - a[v]) - q * (c[u] - a[u])) / area
                    to_c = ((b[u] - a[u]) * q - (b[v] - a[v]) * p) / area
                    if to_b < 0.0 or to_c < 0.0 or to_b + to_c > 1.0:
                        continue
                    place = a[axis] + to_b * (b[axis] - a[axis]) + to_c * (c[axis] - a[axis])
                    if place < nearest[0, i, j]:
                        nearest[0, i, j], facing[0, i, j] = place, 1 if area < 0.0 else -1
                    if -place < nearest[1, i, j]:
                        nearest[1, i, j], facing[1, i, j] = -place, 1 if area > 0.0 else -1
        for end in range(2):
            for i in range(_RAYS):
                for j in range(_RAYS):
                    wrong += facing[end, i, j] < 0
                    right += facing[end, i, j] > 0
    return wrong / max(wrong + right, 1)
