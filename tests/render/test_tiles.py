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
