"""Solids over outlines: closed, and as large as the shoelace formula says."""

import numpy as np
import pytest
import trimesh

from sonar_component.scene import Mesh, polygon


def star(centre: tuple[float, float], radius: float, corners: int, rng: np.random.Generator) -> np.ndarray:
    """An outline with deep notches that never crosses itself."""
    angle = (np.arange(corners) + rng.uniform(0, 0.8, corners)) * 2 * np.pi / corners
    r = radius * rng.uniform(0.55, 1.0, corners)
    return np.stack([centre[0] + r * np.cos(angle), centre[1] + r * np.sin(angle)], 1)


def area(ring: np.ndarray) -> float:
    x, y = ring.T
    return float(abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2)


@pytest.mark.parametrize("seed", range(12))
def test_a_notched_outline_with_holes_has_its_volume_and_is_closed(seed: int) -> None:
    rng = np.random.default_rng(seed)
    outer = star((0, 0), 10, 40, rng)
    holes = [star((2.4 * np.cos(a), 2.4 * np.sin(a)), 0.9, 9, rng) for a in (0.3, 1.9, 3.4, 5.0)]
    mesh = polygon.extruded([outer, *holes], 3.0)
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    solid.merge_vertices()
    assert solid.is_watertight
    # The vertices lie on a grid of 1 um, so each metre of outline can lose that much.
    assert solid.volume == pytest.approx(3 * (area(outer) - sum(area(hole) for hole in holes)), rel=1e-5)


def test_corners_that_lie_in_a_row_are_no_obstacle() -> None:
    half = [(0.15, -0.15), (0.15, -0.12), (0.015, -0.12), (0.015, 0.12), (0.15, 0.12), (0.15, 0.15)]
    beam = np.array(half + [(-x, -y) for x, y in half])  # an I-beam
    mesh = polygon.extruded([beam], 2.0)
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    solid.merge_vertices()
    assert solid.is_watertight
    assert solid.volume == pytest.approx(2 * (2 * 0.3 * 0.03 + 0.03 * 0.24))


def test_points_along_a_straight_edge_are_no_obstacle() -> None:
    comb = np.array([(0, 0), (1, 0), (2, 0), (3, 0), (3, 1), (2, 1), (1, 1), (0, 1)], float)
    assert trimesh.Trimesh(*_arrays(polygon.extruded([comb], 1.0))).volume == pytest.approx(3)


def _arrays(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    return mesh.vertices, mesh.faces


def test_winding_and_repeated_points_make_no_difference() -> None:
    square = np.array([[0, 0], [2, 0], [2, 2], [0, 2]], float)
    closed = np.concatenate([square[::-1], square[-1:]])
    volumes = [
        trimesh.Trimesh(mesh.vertices, mesh.faces).volume
        for mesh in (polygon.extruded([square], 1.5), polygon.extruded([closed], 1.5))
    ]
    assert volumes == pytest.approx([6, 6])


def test_too_many_points_are_refused() -> None:
    angle = np.linspace(0, 6, polygon.MAX_POINTS + 1)
    with pytest.raises(ValueError, match=f"at most {polygon.MAX_POINTS} points"):
        polygon.extruded([np.stack([np.cos(angle), np.sin(angle)], 1)], 1)


@pytest.mark.parametrize(
    "outlines",
    [
        [[(-1, -1), (1, 1), (1, -1), (-1, 1)]],
        [[(-1, -1), (1, 0.8), (1, -1), (-1, 1)]],
        [[(0, 0), (4, 0), (4, 4), (0, 4)], [(3, 1), (5, 1), (5, 2), (3, 2)]],
    ],
    ids=["bow-tie", "lopsided bow-tie", "hole across the edge"],
)
def test_sides_that_cross_are_refused_and_named(outlines: list[list[tuple[float, float]]]) -> None:
    with pytest.raises(ValueError, match=r"must not cross itself or another one; \(.*\) to \(.*\) does"):
        polygon.extruded([np.array(ring, float) for ring in outlines], 1.0)


def test_outlines_that_touch_are_allowed() -> None:
    square = np.array([(0, 0), (4, 0), (4, 4), (0, 4)], float)
    assert polygon.extruded([square, np.array([(4, 1), (3, 2), (3, 1)], float)], 1.0).faces.size
