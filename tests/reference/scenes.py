"""Worlds simple enough that their echoes can be written down."""

from __future__ import annotations

from typing import Any

import numpy as np

from sonar_component.scene import Body, Material, Mesh, Part, World
from sonar_component.scene.shapes import box, plane, sphere


def rectangle(corners: Any, uv: Any = None, flipped: bool = False) -> Mesh:
    """Four corners counter-clockwise as seen from where the normal points; `flipped` turns winding and normal round."""
    vertices = np.array(corners, np.float64)
    normal = np.cross(vertices[1] - vertices[0], vertices[3] - vertices[0])
    normal /= np.linalg.norm(normal) * (-1 if flipped else 1)
    faces = np.array([[0, 2, 1], [0, 3, 2]] if flipped else [[0, 1, 2], [0, 2, 3]], np.int32)
    return Mesh(
        vertices, np.tile(normal.astype(np.float32), (4, 1)), faces, None if uv is None else np.array(uv, np.float32)
    )


def plate(distance: float, width: float, height: float, y: float = 0.0, z: float = 0.0, **options: Any) -> Mesh:
    """A rectangle across the X axis that faces back along it; its first corner is the lower right one from there."""
    left, right, low, high = y + width / 2, y - width / 2, z - height / 2, z + height / 2
    return rectangle(
        [[distance, right, low], [distance, left, low], [distance, left, high], [distance, right, high]],
        flipped=not options.pop("flipped", False), **options,
    )  # fmt: skip


def wall(distance: float) -> Mesh:
    """A plate that fills any fan of up to 150 deg."""
    return plate(distance, 40 * distance, 40 * distance)


def tilted_wall(distance: float, tilt: float) -> Mesh:
    """A wall that the X axis meets at `distance`, turned about the vertical there so that its left side is farther."""
    side, up = np.array([np.sin(tilt), np.cos(tilt), 0]), np.array([0, 0, 1])
    centre, reach = np.array([distance, 0, 0]), 40 * distance
    return rectangle([centre + reach * (a * side + b * up) for a, b in ((1, -1), (-1, -1), (-1, 1), (1, 1))])


def floor(depth: float, size: float = 400.0) -> Mesh:
    """A horizontal plane below the origin."""
    half = size / 2
    return rectangle([[-half, -half, -depth], [half, -half, -depth], [half, half, -depth], [-half, half, -depth]])


def shell(radius: float, azimuth: float, elevation: float, step: float = np.radians(0.5)) -> Mesh:
    """Part of a sphere around the origin, seen from inside; `azimuth` and `elevation` are half of what it covers."""
    columns, rows = (2 * int(np.ceil(half / step)) + 1 for half in (azimuth, elevation))
    az, el = np.meshgrid(np.linspace(-azimuth, azimuth, columns), np.linspace(-elevation, elevation, rows))
    outward = np.stack([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)], axis=-1).reshape(-1, 3)
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    quad = np.stack([first, first + columns, first + columns + 1, first, first + columns + 1, first + 1], axis=1)
    return Mesh(radius * outward, (-outward).astype(np.float32), quad.reshape(-1, 3).astype(np.int32))


def world(*meshes: Mesh | tuple[Mesh, Any], material: Material | None = None) -> World:
    """One body for each mesh or (mesh, position)."""
    bodies = []
    for number, item in enumerate(meshes):
        mesh, position = item if isinstance(item, tuple) else (item, (0, 0, 0))
        X_WB = np.eye(4)
        X_WB[:3, 3] = position
        bodies.append(Body(f"body{number}", [Part(mesh, material or Material("plain"), np.eye(4))], X_WB))
    return World(bodies)


def moved(meshes: list[tuple[Mesh, Any]], offset: Any) -> World:
    """The same meshes with the whole scene moved."""
    return world(*((mesh, np.asarray(position) + offset) for mesh, position in meshes))


# The scene of the original simulator's frames: floor, sphere and box; its sonar stands at (0, 0, 3), pitched 15 deg.
STANDARD: list[tuple[Mesh, Any]] = [
    (plane((200, 200)), (0, 0, 0)),
    (sphere(1.5), (12, -3, 1.5)),
    (box((3, 2, 2)), (15, 4, 1)),
]
