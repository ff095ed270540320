"""Closed shells: found whatever their file did to corners and winding, and open surfaces never taken for one."""

from __future__ import annotations

import numpy as np
import pytest

from sonar_component.render.closed import cone, find_shells
from sonar_component.scene import Mesh
from sonar_component.scene.shapes import box, capsule, cylinder, plane, sphere

SOLIDS = {"box": box((1, 2, 3)), "ball": sphere(1.5), "drum": cylinder(1, 3), "capsule": capsule(1, 3)}


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = vertices[faces].transpose(1, 0, 2)
    return float((a * np.cross(b, c)).sum() / 6)


@pytest.mark.parametrize("mesh", SOLIDS.values(), ids=SOLIDS.keys())
@pytest.mark.parametrize("inwards", [False, True])
def test_a_solid_is_one_shell_wound_outwards(mesh: Mesh, inwards: bool) -> None:
    found = find_shells(mesh.vertices, mesh.faces[:, ::-1] if inwards else mesh.faces)
    assert set(found.number) == {0}
    assert volume(mesh.vertices, found.faces) > 0
    np.testing.assert_array_equal(np.sort(found.faces, axis=1), np.sort(mesh.faces, axis=1))
    np.testing.assert_allclose(found.hull(np.arange(3, dtype=np.int32)), mesh.bounds)


@pytest.mark.parametrize("gone", [0, 7, -1])
def test_one_missing_face_opens_the_whole_shell(gone: int) -> None:
    ball = sphere(1.5)
    assert set(find_shells(ball.vertices, np.delete(ball.faces, gone, axis=0)).number) == {-1}


def test_one_face_wound_against_the_others_opens_the_shell() -> None:
    cube = box((1, 1, 1))
    faces = cube.faces.copy()
    faces[3] = faces[3, ::-1]
    assert set(find_shells(cube.vertices, faces).number) == {-1}


def test_two_boxes_that_share_an_edge_are_left_alone() -> None:
    """Four faces meet in that edge, and which of them go together nobody said."""
    cube = box((1, 1, 1))
    vertices = np.concatenate([cube.vertices, cube.vertices + np.array([1, 1, 0])])
    found = find_shells(vertices, np.concatenate([cube.faces, cube.faces + len(cube.vertices)]))
    assert set(found.number) == {-1}


def test_each_shell_of_a_mesh_is_judged_alone() -> None:
    """A ball, an inverted box and an open sheet, far from the origin of their frame."""
    ball, cube, sheet = sphere(0.5), box((1, 1, 1)), plane((3, 3))
    away = np.array([400.0, -300.0, 20.0])
    vertices = (
        np.concatenate([ball.vertices, cube.vertices + np.array([4, 0, 0]), sheet.vertices - np.array([0, 0, 2])])
        + away
    )
    pieces = [
        ball.faces,
        cube.faces[:, ::-1] + len(ball.vertices),
        sheet.faces + len(ball.vertices) + len(cube.vertices),
    ]
    found = find_shells(vertices, np.concatenate(pieces))
    of_ball, of_cube, of_sheet = np.split(found.number, np.cumsum([len(piece) for piece in pieces])[:-1])
    assert [set(part) for part in (of_ball, of_cube, of_sheet)] == [{0}, {1}, {-1}]
    for number in (0, 1):
        assert volume(vertices - away, found.faces[found.number == number]) > 0
    np.testing.assert_allclose(found.least[1], away + np.array([3.5, -0.5, -0.5]))


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_mesh_with_a_vertex_that_is_not_finite_has_no_shells(bad: float) -> None:
    vertices = box((1, 1, 1)).vertices.copy()
    vertices[5, 1] = bad
    assert set(find_shells(vertices, box((1, 1, 1)).faces).number) == {-1}


def test_points_and_lines_among_the_faces_open_nothing() -> None:
    cube = box((1, 1, 1))
    faces = np.concatenate([cube.faces, np.array([[0, 0, 0], [0, 1, 1]], np.int32)])
    assert find_shells(cube.vertices, faces).number.tolist() == [0] * 12 + [-1] * 2


def test_no_faces_have_no_shells() -> None:
    assert len(find_shells(np.zeros((0, 3)), np.zeros((0, 3), np.int32)).number) == 0


def test_the_cone_of_normals_holds_each_of_them() -> None:
    ball = sphere(1.0)
    cap = ball.faces[ball.vertices[ball.faces][:, :, 2].min(axis=1) > 0.8]
    axis, spread = cone(ball.vertices, cap)
    np.testing.assert_allclose(axis, [0, 0, 1], atol=1e-3)
    a, b, c = ball.vertices[cap].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    angles = np.arccos(np.clip(normals @ axis / np.linalg.norm(normals, axis=1), -1, 1))
    assert angles.max() <= spread + 1e-9
    assert spread < np.arccos(0.75)  # the faces of a cap lie within its rim


def test_the_cone_of_a_whole_ball_is_everything() -> None:
    ball = sphere(1.0)
    assert cone(ball.vertices, ball.faces)[1] > np.radians(170)


def drawn_out(outline: np.ndarray, height: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """A closed prism over an outline (n, 2), each of its ends a fan around the middle."""
    n = len(outline)
    low, high = (np.column_stack([outline, np.full(n, z)]) for z in (0.0, height))
    vertices = np.concatenate([low, high, [[*outline.mean(axis=0), 0.0]], [[*outline.mean(axis=0), height]]])
    i, j = np.arange(n), (np.arange(n) + 1) % n
    sides = np.concatenate([np.stack([i, j, j + n], 1), np.stack([i, j + n, i + n], 1)])
    ends = np.concatenate([np.stack([j, i, np.full(n, 2 * n)], 1), np.stack([i + n, j + n, np.full(n, 2 * n + 1)], 1)])
    return vertices, np.concatenate([sides, ends]).astype(np.int32)


def test_a_shell_that_passes_through_itself_is_drawn_from_both_sides() -> None:
    """One lobe of a lopsided figure of eight is inside out, whichever way the whole is turned."""
    square = np.array([[0, 0], [2, 0], [2, 1], [0, 1.0]])
    assert set(find_shells(*drawn_out(square)).number) == {0}
    assert set(find_shells(*drawn_out(square[[0, 1, 3, 2]] * (1, 1) + [[0, 0], [0, 0], [0, 0], [1, 0]])).number) == {-1}
    ball = sphere(1.0)
    assert set(find_shells(ball.vertices, ball.faces).number) == {0}
    pushed = ball.vertices.copy()
    pushed[:, 2] -= 3.0 * np.clip(pushed[:, 2] - 0.6, 0, None) / 0.4  # its top through its bottom
    assert set(find_shells(pushed, ball.faces).number) == {-1}


def test_a_crossed_shell_beside_a_sound_one_leaves_that_alone() -> None:
    vertices, faces = drawn_out(np.array([[0, 0], [2, 0], [0, 1], [3, 1.0]]))
    cube = box((1, 1, 1))
    found = find_shells(
        np.concatenate([vertices, cube.vertices + np.array([9, 0, 0])]),
        np.concatenate([faces, cube.faces + len(vertices)]),
    )
    assert set(found.number[: len(faces)]) == {-1}
    assert len(set(found.number[len(faces) :]) - {-1}) == 1


def test_a_hollow_ball_and_a_dented_one_are_sound() -> None:
    ball = sphere(1.0)
    hollow = np.concatenate([ball.vertices, 0.7 * ball.vertices])
    faces = np.concatenate([ball.faces, ball.faces[:, ::-1] + len(ball.vertices)])
    assert -1 not in find_shells(hollow, faces).number
    dented = ball.vertices.copy()
    dented[:, 2] -= 1.2 * np.clip(dented[:, 2] - 0.6, 0, None) / 0.4
    assert set(find_shells(dented, ball.faces).number) == {0}
