"""Tiles: each triangle in one of them, and none that a view sees is left out."""

from __future__ import annotations

import numpy as np
import pytest

from sonar_component.render import tiles
from sonar_component.scene import Mesh
from sonar_component.scene.shapes import box, grid_faces, plane, sphere

NO_VERTICES, NO_FACES = np.zeros((0, 3)), np.zeros((0, 3), np.int32)


def terrain(size: int) -> tuple[np.ndarray, np.ndarray]:
    x, y = np.meshgrid(np.linspace(0, 100, size), np.linspace(0, 100, size))
    return np.stack([x.ravel(), y.ravel(), np.sin(x / 9).ravel()], axis=1), grid_faces(size, size)


def test_each_triangle_is_in_exactly_one_tile() -> None:
    vertices, faces = terrain(80)
    pieces = tiles.split(vertices, faces)
    assert sorted(np.concatenate(pieces)) == list(range(len(faces)))
    assert len(pieces) > 8
    assert max(len(piece) for piece in pieces) <= tiles.TILE_FACES


def test_triangles_of_one_place_fall_into_tiles_too() -> None:
    # A median cannot part what lies alike: 5000 copies of one triangle.
    vertices = np.eye(3)
    pieces = tiles.split(vertices, np.tile(np.array([[0, 1, 2]], np.int32), (5000, 1)))
    assert sum(len(piece) for piece in pieces) == 5000
    assert max(len(piece) for piece in pieces) <= tiles.TILE_FACES


def test_a_few_huge_triangles_do_not_stretch_the_tiles_of_the_others() -> None:
    vertices, faces = terrain(60)
    floor, ball = plane((400, 400)), vertices * 0.01
    joined = np.concatenate([floor.vertices, ball])
    pieces = tiles.split(joined, np.concatenate([floor.faces, faces + len(floor.vertices)]))
    radii = [
        tiles.bounding_sphere(joined[np.concatenate([floor.faces, faces + 4])[piece].ravel()])[1] for piece in pieces
    ]
    assert sum(radius > 1 for radius in radii) == 1


@pytest.mark.parametrize("vertices", [NO_VERTICES, np.eye(3)])
def test_a_mesh_without_triangles_has_no_tiles(vertices: np.ndarray) -> None:
    assert tiles.split(vertices, NO_FACES) == []


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_faces_with_a_vertex_that_is_not_finite_are_in_no_tile_and_the_others_are(bad: float) -> None:
    vertices, faces = terrain(40)
    vertices[77, 1] = bad
    pieces = tiles.split(vertices, faces)
    sound = np.flatnonzero(~(faces == 77).any(axis=1))
    assert len(sound) == len(faces) - 6
    assert sorted(np.concatenate(pieces)) == sound.tolist()
    assert all(np.isfinite(tiles.bounding_sphere(vertices[faces[piece].ravel()])[1]) for piece in pieces)


@pytest.mark.parametrize("mesh", [box((1, 2, 3)), sphere(0.7), plane((5, 1))])
def test_a_sphere_holds_all_its_points_and_is_not_much_too_large(mesh: Mesh) -> None:
    points = mesh.vertices + np.array([10, -20, 5])
    centre, radius = tiles.bounding_sphere(points)
    distances = np.linalg.norm(points - centre, axis=1)
    assert distances.max() <= radius * (1 + 1e-12)
    assert radius <= np.linalg.norm(np.ptp(points, axis=0)) / 2 * (1 + 1e-12)


@pytest.mark.parametrize(
    ("width", "up"), [(1, 10), (20, 10), (45, 5), (45, 60), (45, 75), (0.2, 0.1)], ids=lambda v: f"{v:g}"
)
def test_no_sphere_with_a_point_in_a_view_is_left_out(width: float, up: float) -> None:
    rng = np.random.default_rng(7)
    azimuths, half, tangent, range_max = (
        np.radians([-170, -30, 0, 100]),
        np.radians(width / 2),
        np.tan(np.radians(up)),
        30.0,
    )
    centres = rng.normal(size=(400, 3)) * np.array([20, 20, 8])
    radii = 10.0 ** rng.uniform(-2, 1.3, 400)
    made = tiles.seen(centres, radii, azimuths, half, tangent, range_max)
    directions = rng.normal(size=(400, 300, 3))
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    points = centres[:, None] + directions * (radii[:, None] * rng.random((400, 300)) ** (1 / 3))[:, :, None]
    found = np.zeros_like(made)
    for number, azimuth in enumerate(azimuths):
        depth = points @ [np.cos(azimuth), np.sin(azimuth), 0]
        side = points @ [-np.sin(azimuth), np.cos(azimuth), 0]
        within = (np.abs(side) < depth * np.tan(half)) & (np.abs(points[:, :, 2]) < depth * tangent)
        found[number] = (within & (np.linalg.norm(points, axis=2) < range_max)).any(axis=1)
    assert found.any() or width < 1  # the samples do hit, or the test would say nothing
    assert not (found & ~made).any()


def test_most_of_what_is_out_of_sight_is_left_out() -> None:
    rng = np.random.default_rng(8)
    centres, radii = rng.uniform(-100, 100, (2000, 3)), np.full(2000, 0.5)
    made = tiles.seen(centres, radii, np.zeros(1), np.radians(10), np.tan(np.radians(10)), 30.0)[0]
    depth, side = centres[:, 0], np.abs(centres[:, 1])
    # Twice the radius around the view's planes; a sphere touches a corner only where it is nearer.
    loose = (depth > -1) & (side < (depth + 6) * np.tan(np.radians(10)) + 1) & (np.linalg.norm(centres, axis=1) < 31)
    assert not made[~loose].any()


def test_a_sphere_around_the_sonar_is_seen_by_every_view() -> None:
    made = tiles.seen(np.zeros((1, 3)), np.ones(1), np.radians([-180.0, -90, 0, 90]), 0.2, 0.1, 30.0)
    assert made.all()
