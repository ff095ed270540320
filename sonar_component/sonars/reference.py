"""The converged truth of an image: rays in float64, doubled until the answer no longer moves.

Nothing here is shared with the renderer: its own grid of rays, its own ray caster (Embree, through embreex), ranges and
normals in float64 on the triangle that was hit, its own sums. Each ray stands for a cell of azimuth x elevation and
spreads its solid angle over the ranges that its triangle's plane has inside the cell; silhouettes are what the
doublings have to resolve.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonar_component.echo.beams import BeamTable
from sonar_component.scene.world import World

Array = NDArray[np.float64]

AGREEMENT = 1e-3  # [-], of successive doublings, in both errors
_FIRST = (4, 256)  # [-], columns per beam and rows of the first grid
_MOST = (64, 8192)  # [-], of the last
_CHUNK = 1 << 20  # [-], rays at a time
_RESIDUE = 1e-12  # [-], of a beam's solid angle
_GOLDEN = 0.6180339887498949


@dataclass(frozen=True)
class Sums:
    """Integrals over each bin, all (beams, bins) float64.

    Attributes
    ----------
    solid_angle : of the surface [sr].
    energy : of the Lambert term times reflectance [sr].
    transferred : of the transfer of that term [sr].
    beam : (beams,) float64
        Solid angle of each beam [sr].
    """

    solid_angle: Array
    energy: Array
    transferred: Array
    beam: Array

    def coarser(self, beams: int, bins: int) -> Sums:
        """The same scene with `beams` neighbouring beams and `bins` neighbouring bins taken together."""

        def join(x: Array) -> Array:
            return np.asarray(x.reshape(len(x) // beams, beams, -1, bins).sum(axis=(1, 3)))

        whole_beams = self.beam.reshape(-1, beams).sum(axis=1)
        return Sums(join(self.solid_angle), join(self.energy), join(self.transferred), whole_beams)

    def mean(self) -> Array:
        """I of IMAGE FORMATION: the mean of the transfer over the surface in a bin; 0 where there is none."""
        return np.divide(self.transferred, self.solid_angle, out=np.zeros_like(self.energy), where=self.solid_angle > 0)

    def relative_energy(self) -> Array:
        """E: the energy relative to the beam's solid angle."""
        return np.asarray(self.energy / self.beam[:, None])


@dataclass(frozen=True)
class Errors:
    """How far an image is from the reference [-].

    Attributes
    ----------
    energy : 2-norm of the difference of E over that of E.
    mean : the same of I, each bin weighted by the reference's solid angle.
    missed : share of the bins with more than 1e-5 of their beam's solid angle that came out empty.
    false : share of the empty bins lit above 0.02.
    """

    energy: float
    mean: float
    missed: float
    false: float


def errors(reference: Sums, energy: Array, mean: Array) -> Errors:
    """Compare an energy image and a mean image, (beams, bins) each, with the reference."""
    E, I, w = reference.relative_energy(), reference.mean(), reference.solid_angle  # noqa: E741 (the symbols of Eq. 1)
    seen = w > 1e-5 * reference.beam[:, None]
    empty = w <= 0
    return Errors(
        energy=float(np.linalg.norm(energy - E)) / max(float(np.linalg.norm(E)), 1e-300),
        mean=float(np.sqrt((w * (mean - I) ** 2).sum() / max((w * I**2).sum(), 1e-300))),
        missed=float((mean[seen] <= 0).mean()) if seen.any() else 0.0,
        false=float((mean[empty] > 0.02).mean()) if empty.any() else 0.0,
    )


def converged(
    world: World,
    X_WS: Array,
    beams: BeamTable,
    range_max: float,
    bin_count: int,
    transfer: Callable[[Array], Array],
    report: Callable[[str], None] = lambda line: None,
) -> Sums:
    """Double rays until energy and mean agree to AGREEMENT.

    Parameters
    ----------
    transfer : function of (n,) float64
        The paper's S.
    report : function
        Told of each doubling, in words.

    Raises
    ------
    RuntimeError
        If the last grid has not converged, or embreex is not installed.
    """
    caster = _Caster(world, X_WS)
    columns, rows = _FIRST
    last: Sums | None = None
    while columns <= _MOST[0]:
        sums = _integrate(caster, beams, range_max, bin_count, transfer, columns, rows)
        if last is not None:
            step = errors(sums, last.relative_energy(), last.mean())
            report(f"{columns} x {rows} rays per beam: energy moved {step.energy:.5f}, mean {step.mean:.5f}")
            if max(step.energy, step.mean) <= AGREEMENT:
                return sums
        last, columns, rows = sums, 2 * columns, 2 * rows
    raise RuntimeError(f"the reference has not converged with {_MOST[0]} x {_MOST[1]} rays per beam")


class _Caster:
    """The world's triangles in the sonar's frame, float64, and Embree over them."""

    def __init__(self, world: World, X_WS: Array) -> None:
        try:
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore_scene import EmbreeScene
        except ImportError:
            raise RuntimeError('the reference needs an extra: pip install "sonar-component[reference]"') from None
        corners, normals, reflectance = [], [], []
        X_SW = np.linalg.inv(X_WS)
        for body in world.bodies.values():
            for part in body.parts:
                X_SM = X_SW @ body.X_WB @ part.X_BM
                points = part.mesh.vertices @ X_SM[:3, :3].T + X_SM[:3, 3]
                corners.append(points[part.mesh.faces])
                normals.append((part.mesh.normals @ X_SM[:3, :3].T)[part.mesh.faces])
                reflectance.append(np.full(len(part.mesh.faces), part.material.reflectance))
        self._corners = np.concatenate(corners).astype(np.float64)
        self._normals = np.concatenate(normals).astype(np.float64)
        self._reflectance = np.concatenate(reflectance)
        self._plane = np.cross(self._corners[:, 1] - self._corners[:, 0], self._corners[:, 2] - self._corners[:, 0])
        self._scene = EmbreeScene()
        self._mesh = TriangleMesh(self._scene, self._corners.astype(np.float32))

    def hits(self, directions: Array) -> tuple[NDArray[np.intp], NDArray[np.intp], Array, Array]:
        """Which rays hit, which triangle, normal . ray, and that times reflectance: indices, (n,), (n,)."""
        origins = np.zeros(directions.shape, np.float32)
        found = self._scene.run(origins, directions.astype(np.float32), output=1)
        which = np.flatnonzero(found["primID"] >= 0)
        triangle = found["primID"][which].astype(np.intp)
        u, v = found["u"][which].astype(np.float64)[:, None], found["v"][which].astype(np.float64)[:, None]
        normal = self._normals[triangle]
        normal = normal[:, 0] * (1 - u - v) + normal[:, 1] * u + normal[:, 2] * v
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        lambert = np.abs(np.einsum("ij,ij->i", normal, directions[which])) * self._reflectance[triangle]
        return which, triangle, lambert, self.ranges(triangle, directions[which])

    def ranges(self, triangle: NDArray[np.intp], directions: Array) -> Array:
        """Where rays meet the planes of triangles [m]; infinite where they do not."""
        plane = self._plane[triangle]
        offset = np.einsum("ij,ij->i", plane, self._corners[triangle, 0])
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = offset / np.einsum("ij,ij->i", plane, directions)
        return np.asarray(np.where(distance > 0, distance, np.inf))


def _directions(azimuth: Array, elevation: Array) -> Array:
    level = np.cos(elevation)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=-1)


def _integrate(
    caster: _Caster,
    beams: BeamTable,
    range_max: float,
    bin_count: int,
    transfer: Callable[[Array], Array],
    columns: int,
    rows: int,
) -> Sums:
    count = len(beams.bearings)
    sums = np.zeros((3, count, bin_count))
    per_chunk = max(1, _CHUNK // (columns * rows))
    for first in range(0, count, per_chunk):
        chosen = np.arange(first, min(first + per_chunk, count))
        _add_beams(sums, chosen, caster, beams, range_max / bin_count, transfer, columns, rows)
    # What the running sums leave behind, 1e-16 of a beam, is no surface; a mean of it would be any number.
    sums[:, sums[0] < _RESIDUE * beams.solid_angle[:, None]] = 0.0
    return Sums(sums[0], sums[1], sums[2], beams.solid_angle)


def _add_beams(
    sums: Array,
    chosen: NDArray[np.intp],
    caster: _Caster,
    beams: BeamTable,
    bin_length: float,
    transfer: Callable[[Array], Array],
    columns: int,
    rows: int,
) -> None:
    width = (beams.left - beams.right)[chosen] / columns
    azimuth = (beams.right[chosen, None] + (np.arange(columns) + 0.5) * width[:, None]).ravel()
    # Cells of each column, shifted by the golden ratio so that no edge lies alike in all of them.
    shift = (np.arange(len(azimuth)) * _GOLDEN) % 1 - 0.5
    h, step = beams.half_height, 2 * beams.half_height / rows
    inner = -h + (np.arange(1, rows)[None, :] + shift[:, None]) * step
    edges = np.concatenate([np.full((len(azimuth), 1), -h), inner, np.full((len(azimuth), 1), h)], axis=1)
    low, high = edges[:, :-1].ravel(), edges[:, 1:].ravel()
    azimuth, half = np.repeat(azimuth, rows), np.repeat(np.repeat(width, columns), rows) / 2
    beam = np.repeat(chosen, columns * rows)
    solid_angle = (np.sin(high) - np.sin(low)) * 2 * half
    which, triangle, lambert, distance = caster.hits(_directions(azimuth, (low + high) / 2))
    azimuth, half, low, high = azimuth[which], half[which], low[which], high[which]
    middle = (low + high) / 2
    along = _span(caster, triangle, distance, _directions(azimuth, low), _directions(azimuth, high))
    across = _span(caster, triangle, distance, _directions(azimuth - half, middle), _directions(azimuth + half, middle))
    extent = np.maximum(np.hypot(along, across) / bin_length, 1e-9)
    values: tuple[Array, ...] = (np.ones_like(lambert), lambert, transfer(lambert))
    for k, value in enumerate(values):
        _spread(sums[k], beam[which], distance / bin_length - extent / 2, extent, solid_angle[which] * value)


def _span(caster: _Caster, triangle: NDArray[np.intp], distance: Array, one: Array, other: Array) -> Array:
    """Extent in range of a triangle's plane between two directions, at most twice the range itself [m]."""
    far = 3 * distance
    a, b = (np.minimum(caster.ranges(triangle, directions), far) for directions in (one, other))
    return np.asarray(np.abs(a - b))


def _spread(out: Array, beam: NDArray[np.intp], low: Array, extent: Array, value: Array) -> None:
    """Add boxes [low, low + extent] in bins: the second differences of their integrals, summed twice."""
    bins = out.shape[1]
    corners = np.zeros(out.shape[0] * (bins + 2))
    for place, sign in ((low, 1.0), (low + extent, -1.0)):
        place = np.clip(place, 0.0, bins)
        k = place.astype(np.intp)
        slope, part = sign * value / extent, place - k
        for step, weight in ((0, 1 - part), (1, part)):
            corners += np.bincount(beam * (bins + 2) + k + step, slope * weight, corners.size)
    out += np.maximum(np.cumsum(corners.reshape(out.shape[0], bins + 2), axis=1)[:, :bins], 0.0)
