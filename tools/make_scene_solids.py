"""Solids that the scene scripts are built from: each returns a list of `Solid`, plain vertices and faces in metres.

Not run by itself; see make_wreck_scene.py and make_experiment_scenes.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import trimesh

Points = np.ndarray


@dataclass
class Solid:
    """Vertices (n, 3) [m] and faces (m, 3)."""

    vertices: Points
    faces: np.ndarray


def join(solids: Sequence[Solid]) -> Solid:
    starts = np.cumsum([0, *(len(s.vertices) for s in solids)])
    faces = [s.faces + start for s, start in zip(solids, starts[:-1], strict=True)]
    return Solid(np.concatenate([s.vertices for s in solids]), np.concatenate(faces))


def moved(solid: Solid, position: Sequence[float] = (0, 0, 0), rpy_deg: Sequence[float] = (0, 0, 0)) -> Solid:
    X = trimesh.transformations.euler_matrix(*np.radians(rpy_deg))
    return Solid(solid.vertices @ X[:3, :3].T + np.asarray(position, float), solid.faces)


def grid(points: Points, keep: np.ndarray | None = None) -> Solid:
    """A sheet over points (rows, columns, 3); `keep` (rows - 1, columns - 1) says which of its squares are there."""
    rows, columns = points.shape[:2]
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns - 1), indexing="ij")
    first = (i * columns + j)[keep if keep is not None else np.ones_like(i, bool)]
    quads = np.stack([first, first + 1, first + columns + 1, first, first + columns + 1, first + columns], 1)
    faces = quads.reshape(-1, 3)
    used, renumbered = np.unique(faces, return_inverse=True)
    return Solid(points.reshape(-1, 3)[used], renumbered.reshape(-1, 3))


def box(size: Sequence[float], position: Sequence[float] = (0, 0, 0), rpy_deg: Sequence[float] = (0, 0, 0)) -> Solid:
    m = trimesh.creation.box(size)
    return moved(Solid(np.array(m.vertices), np.array(m.faces)), position, rpy_deg)


def sweep(path: Points, profile: Callable[[float], Points], closed: bool = False) -> Solid:
    """Carry a closed outline along a path (n, 3); `profile(s)`, s in 0..1, gives its points (k, 2) across the path."""
    path = np.asarray(path, float)
    tangent = np.gradient(path, axis=0)
    if closed:
        tangent = np.roll(path, -1, axis=0) - np.roll(path, 1, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    up = np.array([0.0, 0.0, 1.0]) if abs(tangent[0, 2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    rings = []
    for k, (p, t) in enumerate(zip(path, tangent, strict=True)):
        up = up - t * (up @ t)
        up /= np.linalg.norm(up)
        side = np.cross(up, t)
        outline = profile(k / (len(path) - 1))
        rings.append(p + outline[:, :1] * side + outline[:, 1:] * up)
    ring = np.array(rings)
    n, k = ring.shape[:2]
    around = np.concatenate([ring, ring[:, :1]], axis=1)
    if closed:
        around = np.concatenate([around, around[:1]], axis=0)
        return welded(grid(around))
    ends = []
    for end, flip in ((0, False), (n - 1, True)):
        centre = ring[end].mean(axis=0)
        vertices = np.concatenate([[centre], ring[end]])
        i = np.arange(k)
        faces = np.stack([np.zeros(k, int), 1 + i, 1 + (i + 1) % k], 1)
        ends.append(Solid(vertices, faces[:, ::-1] if flip else faces))
    return welded(join([grid(around), *ends]))


def welded(solid: Solid) -> Solid:
    m = trimesh.Trimesh(solid.vertices, solid.faces, process=False)
    m.merge_vertices()
    return Solid(np.array(m.vertices), np.array(m.faces))


def circle(radius: float, sides: int) -> Points:
    a = np.arange(sides) * 2 * np.pi / sides
    return radius * np.stack([np.cos(a), np.sin(a)], 1)


def bar(width: float, height: float) -> Points:
    return np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (width / 2, height / 2)


def tube(path: Points, radius: float | Sequence[float], sides: int = 12, closed: bool = False) -> Solid:
    """A pipe along a path; two radii taper it."""
    r = np.atleast_1d(radius).astype(float)
    return sweep(path, lambda s: circle(np.interp(s, np.linspace(0, 1, len(r)), r), sides), closed)


def rod(a: Sequence[float], b: Sequence[float], radius: float | Sequence[float], sides: int = 12) -> Solid:
    return tube(np.array([a, b], float), radius, sides)


def beam(a: Sequence[float], b: Sequence[float], width: float, height: float) -> Solid:
    return sweep(np.array([a, b], float), lambda _s: bar(width, height))


def ring(centre: Sequence[float], axis: Sequence[float], radius: float, thickness: float, sides: int = 24) -> Solid:
    """A torus, such as a hand wheel."""
    n = np.asarray(axis, float) / np.linalg.norm(axis)
    x = np.cross(n, [0.0, 0.0, 1.0] if abs(n[2]) < 0.9 else [1.0, 0.0, 0.0])
    x /= np.linalg.norm(x)
    a = np.arange(sides) * 2 * np.pi / sides
    path = np.asarray(centre) + radius * (np.outer(np.cos(a), x) + np.outer(np.sin(a), np.cross(n, x)))
    return tube(path, thickness, 8, closed=True)


def flange(centre: Sequence[float], axis: Sequence[float], radius: float, width: float, bolts: int = 12) -> list[Solid]:
    """A pair of discs with bolts around."""
    c, n = np.asarray(centre, float), np.asarray(axis, float) / np.linalg.norm(axis)
    x = np.cross(n, [0.0, 0.0, 1.0] if abs(n[2]) < 0.9 else [1.0, 0.0, 0.0])
    x /= np.linalg.norm(x)
    y = np.cross(n, x)
    solids = [rod(c - n * width, c - n * width * 0.1, radius, 24), rod(c + n * width * 0.1, c + n * width, radius, 24)]
    for a in np.arange(bolts) * 2 * np.pi / bolts:
        p = c + 0.86 * radius * (np.cos(a) * x + np.sin(a) * y)
        solids.append(rod(p - n * width * 1.7, p + n * width * 1.7, radius * 0.06, 6))
    return solids


def valve(centre: Sequence[float], axis: Sequence[float], up: Sequence[float], radius: float) -> list[Solid]:
    """A gate valve: body between two flanges, bonnet, yoke, stem and hand wheel."""
    c, n = np.asarray(centre, float), np.asarray(axis, float)
    u = np.asarray(up, float)
    ball = trimesh.creation.icosphere(subdivisions=2, radius=radius * 1.55)
    solids = [Solid(np.array(ball.vertices) + c, np.array(ball.faces))]
    for side in (-1, 1):
        solids += flange(c + n * side * radius * 2.2, n, radius * 1.7, radius * 0.3)
    side = np.cross(n, u)
    solids.append(rod(c, c + u * radius * 2.6, radius * 0.75, 16))
    solids += flange(c + u * radius * 2.0, u, radius * 1.1, radius * 0.18, 8)
    for s in (-1, 1):
        foot, top = c + u * radius * 2.2 + side * s * radius * 0.8, c + u * radius * 4.2 + side * s * radius * 0.35
        solids.append(rod(foot, top, radius * 0.14, 8))
    solids.append(rod(c + u * radius * 2.2, c + u * radius * 5.6, radius * 0.16, 8))
    hub = c + u * radius * 4.6
    solids.append(ring(hub, u, radius * 1.7, radius * 0.16))
    for a in np.arange(5) * 2 * np.pi / 5:
        solids.append(rod(hub, hub + 1.7 * radius * (np.cos(a) * n + np.sin(a) * side), radius * 0.1, 6))
    return solids


def bend(points: Sequence[Sequence[float]], radius: float, steps: int = 8) -> Points:
    """A path through corner points with rounded corners of the given radius."""
    p = np.asarray(points, float)
    path = [p[0]]
    for before, corner, after in zip(p[:-2], p[1:-1], p[2:], strict=True):
        a, b = (before - corner), (after - corner)
        la, lb = np.linalg.norm(a), np.linalg.norm(b)
        cut = min(radius, la / 2, lb / 2)
        start, end = corner + a / la * cut, corner + b / lb * cut
        path += [(1 - t) ** 2 * start + 2 * t * (1 - t) * corner + t**2 * end for t in np.linspace(0, 1, steps)]
    path.append(p[-1])
    return np.array(path)


def rough(shape: tuple[int, int], cells: Sequence[float], heights: Sequence[float], rng: np.random.Generator) -> Points:
    """Rolling ground: smooth random waves of the given sizes (in samples) and root-mean-square heights, added up."""
    fy, fx = np.meshgrid(np.fft.fftfreq(shape[0]), np.fft.rfftfreq(shape[1]), indexing="ij")
    total = np.zeros(shape)
    for cell, height in zip(cells, heights, strict=True):
        white = np.fft.rfft2(rng.standard_normal(shape))
        layer = np.fft.irfft2(white * np.exp(-0.5 * ((fx**2 + fy**2) * cell**2 * 4)), shape)
        total += height * layer / layer.std()
    return total


def boulder(radius: float, rng: np.random.Generator, subdivisions: int = 3) -> Solid:
    """A stone: a ball squeezed, cut by random planes and roughened."""
    m = trimesh.creation.icosphere(subdivisions=subdivisions)
    v = np.array(m.vertices)
    distance = np.ones(len(v))
    for _ in range(14):
        n = rng.standard_normal(3)
        n /= np.linalg.norm(n)
        cut = rng.uniform(0.62, 0.95)
        facing = v @ n
        distance = np.minimum(distance, np.where(facing > 1e-6, cut / np.maximum(facing, 1e-6), np.inf))
    distance *= 1 + 0.02 * rng.standard_normal(len(v))
    squeeze = rng.uniform(0.6, 1.1, 3)
    return Solid(v * distance[:, None] * squeeze * radius, np.array(m.faces))


def loft(sections: Points) -> Solid:
    """A closed skin over outlines (n, k, 3), with both ends closed."""
    n, k = sections.shape[:2]
    around = np.concatenate([sections, sections[:, :1]], axis=1)
    i = np.arange(k)
    ends = []
    for end, flip in ((0, False), (n - 1, True)):
        faces = np.stack([np.zeros(k, int), 1 + i, 1 + (i + 1) % k], 1)
        centre = sections[end].mean(axis=0, keepdims=True)
        ends.append(Solid(np.concatenate([centre, sections[end]]), faces[:, ::-1] if flip else faces))
    return welded(join([grid(around), *ends]))


def mirrored(solids: Sequence[Solid], axis: int) -> list[Solid]:
    """The same solids on the other side of a plane through the origin."""
    sign = np.ones(3)
    sign[axis] = -1
    return [Solid(solid.vertices * sign, solid.faces[:, ::-1]) for solid in solids]


def lattice(
    a: Sequence[float], u: Sequence[float], v: Sequence[float], cells: tuple[int, int], r: float
) -> list[Solid]:
    """Crossing rods over the parallelogram at corner a with sides u and v."""
    a, u, v = (np.asarray(p, float) for p in (a, u, v))
    rods = [rod(a + u * k / cells[0], a + u * k / cells[0] + v, r, 8) for k in range(cells[0] + 1)]
    return rods + [rod(a + v * k / cells[1], a + v * k / cells[1] + u, r, 8) for k in range(cells[1] + 1)]


def normal_map(heights: Points, cell: float) -> np.ndarray:
    """Tangent-space normals (h, w, 3) uint8 of a relief that repeats; heights and the size of a texel in metres."""
    right = (np.roll(heights, -1, axis=1) - np.roll(heights, 1, axis=1)) / (2 * cell)
    up = (np.roll(heights, 1, axis=0) - np.roll(heights, -1, axis=0)) / (2 * cell)  # the first row is on top
    n = np.stack([-right, -up, np.ones_like(heights)], -1)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    return np.rint(n * 127 + 128).clip(0, 255).astype(np.uint8)


def save_glb(path: str, named: dict[str, tuple[list[Solid], str]]) -> int:
    """Write objects {name: (solids, material name)} as one binary glTF (float32, Z up); returns its triangles."""
    scene = trimesh.Scene()
    for name, (solids, material) in named.items():
        solid = welded(join(solids))
        mesh = trimesh.Trimesh(solid.vertices.astype(np.float32), solid.faces, process=False)
        mesh.visual = trimesh.visual.TextureVisuals(material=trimesh.visual.material.PBRMaterial(name=material))
        scene.add_geometry(mesh, geom_name=name, node_name=name)
    with open(path, "wb") as file:
        file.write(scene.export(file_type="glb"))
    return sum(len(g.faces) for g in scene.geometry.values())
