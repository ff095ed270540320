"""Repair, recentring and normals, against closed forms and hand-made cases."""

import numpy as np
import pytest
import trimesh

from sonar_component.scene.normals import weld
from sonar_component.scene.surface import Surface, to_mesh


def surface(mesh: trimesh.Trimesh, shift: tuple[float, float, float] = (0, 0, 0)) -> Surface:
    return Surface("thing", np.array(mesh.vertices) + shift, np.array(mesh.faces))


def soup(mesh: trimesh.Trimesh) -> Surface:
    """Every triangle with corners of its own, as STL has them."""
    return Surface("thing", mesh.triangles.reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3))


def test_a_sphere_of_loose_triangles_gets_smooth_normals() -> None:
    mesh, _, warnings = to_mesh(soup(trimesh.creation.icosphere(subdivisions=5)))
    radial = mesh.vertices / np.linalg.norm(mesh.vertices, axis=1, keepdims=True)
    # An angle-weighted mean over triangles of 2.2 deg leaves the radius by less than a tenth of one triangle.
    assert np.abs(mesh.normals - radial).max() < np.radians(2.2) / 10
    assert len(mesh.vertices) == 10242  # of an icosphere of five subdivisions: 10 * 4**5 + 2
    assert warnings == []


def test_a_box_keeps_sharp_edges() -> None:
    mesh, _, _ = to_mesh(surface(trimesh.creation.box((1, 2, 3))))
    assert len(mesh.vertices) == 24
    assert np.abs(mesh.normals).max(axis=1) == pytest.approx(1.0)


def test_a_pipe_of_twelve_sides_is_round_and_its_ends_are_flat() -> None:
    mesh, _, _ = to_mesh(surface(trimesh.creation.cylinder(1, 2, sections=12)))
    side = np.abs(mesh.normals[:, 2]) < 0.5
    radial = mesh.vertices[side, :2]
    assert mesh.normals[side, :2] == pytest.approx(radial, abs=1e-6)
    assert np.abs(mesh.normals[~side, 2]) == pytest.approx(1.0)


def test_faces_wound_against_each_other_keep_normals_of_length_one() -> None:
    sphere = trimesh.creation.icosphere(subdivisions=3)
    sphere.faces[::2] = sphere.faces[::2, ::-1]
    mesh, _, _ = to_mesh(surface(sphere))
    assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1.0, abs=1e-6)


def test_a_mesh_at_utm_coordinates_becomes_the_same_bits_as_at_the_origin() -> None:
    stone = trimesh.creation.icosphere(subdivisions=4, radius=1.37)
    stone.vertices = np.round(np.array([0.25, 3.5, -7]) + stone.vertices, 6)  # six digits, as files have them
    here, offset_here, _ = to_mesh(surface(stone))
    there, offset_there, _ = to_mesh(surface(stone, (5e5, 4.65e6, 0)))
    assert np.array_equal(here.vertices, there.vertices)
    assert np.array_equal(here.normals, there.normals)
    assert np.array_equal(offset_there - offset_here, (5e5, 4.65e6, 0))
    assert np.abs(there.vertices).max() < 2  # so that float32 keeps it to a tenth of a micrometre


@pytest.mark.parametrize("nonsense", [np.nan, np.inf, -1e38])
def test_nonsense_vertices_lose_their_faces_and_are_reported_by_name_and_number(nonsense: float) -> None:
    ball = trimesh.creation.icosphere(subdivisions=1)
    vertices = np.array(ball.vertices)
    vertices[0] = nonsense
    mesh, _, warnings = to_mesh(Surface("stern", vertices, np.array(ball.faces)))
    assert np.isfinite(mesh.vertices).all()
    assert len(mesh.faces) == 80 - 5  # five faces meet at a vertex of the icosahedron
    assert warnings == ["'stern': 5 x face with vertices that are NaN or beyond all bounds, dropped"]


def test_faces_without_area_and_indices_beyond_the_end_are_dropped() -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0]], float)
    faces = np.array([[0, 1, 2], [0, 1, 1], [0, 1, 3], [0, 1, 9], [-1, 1, 2]])
    mesh, _, warnings = to_mesh(Surface("plate", vertices, faces))
    assert len(mesh.faces) == 1
    assert warnings == [
        "'plate': 2 x face with a vertex that does not exist, dropped",
        "'plate': 2 x face without area, dropped",
    ]


def test_normals_of_the_file_are_kept_and_those_without_length_are_made() -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
    tilted = np.array([[0, 0.6, 0.8], [0, 0, 0], [np.nan, 0, 1]])
    mesh, _, warnings = to_mesh(Surface("plate", vertices, np.array([[0, 1, 2]]), tilted))
    assert mesh.normals == pytest.approx(np.array([[0, 0.6, 0.8], [0, 0, 1], [0, 0, 1]]))
    assert warnings == ["'plate': 2 x normal without length, computed from its faces"]


def test_texture_seams_survive_the_smoothing() -> None:
    # Two triangles of one plane that share an edge, with texture coordinates of their own.
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    uv = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]])
    mesh, _, _ = to_mesh(Surface("plate", vertices, np.arange(6).reshape(2, 3), None, uv))
    assert mesh.uv is not None
    assert mesh.uv[mesh.faces.ravel()] == pytest.approx(uv)


def test_a_surface_with_no_sound_face_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match="'ghost' has no faces"):
        to_mesh(Surface("ghost", np.full((3, 3), np.nan), np.array([[0, 1, 2]])))


def test_points_are_welded_by_place_alone() -> None:
    rng = np.random.default_rng(3)
    places = rng.integers(-50, 50, (300, 3)).astype(float)
    order = rng.integers(0, 300, 2000)
    labels = weld(places[order] + rng.uniform(-4e-7, 4e-7, (2000, 3)), 1e-6)
    same_label = labels[:, None] == labels[None]
    same_place = (places[order][:, None] == places[order][None]).all(axis=2)
    assert np.array_equal(same_label, same_place)
