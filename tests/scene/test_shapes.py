"""Shapes against their closed-form volumes and normals."""

import numpy as np
import pytest
import trimesh

from sonar_component.scene import shapes
from sonar_component.scene.mesh import Mesh


def solid(mesh: Mesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


CLOSED = [
    (shapes.box((1, 2, 3)), 6.0),
    (shapes.sphere(0.5), 4 / 3 * np.pi * 0.5**3),
    (shapes.sphere(20), 4 / 3 * np.pi * 20**3),
    (shapes.ellipsoid((1, 2, 0.5)), 4 / 3 * np.pi),
    (shapes.cylinder(0.5, 2), np.pi * 0.5**2 * 2),
    (shapes.capsule(0.5, 2), np.pi * 0.5**2 * 2 + 4 / 3 * np.pi * 0.5**3),
]


@pytest.mark.parametrize(("mesh", "volume"), CLOSED)
def test_a_shape_is_closed_faces_outward_and_has_its_volume(mesh: Mesh, volume: float) -> None:
    body = solid(mesh)
    flat = body.face_normals
    smooth = mesh.normals[mesh.faces].mean(axis=1)
    assert np.einsum("ij,ij->i", flat, smooth).min() > 0.9  # shading and winding agree on what is outside
    body.merge_vertices()
    assert body.is_watertight
    # Inscribed with at least 24 sides: the volume lacks at most 2 (pi / 24)^2 = 3.4 % times 2/3 for both directions.
    assert volume * 0.977 < body.volume <= volume * 1.000001


@pytest.mark.parametrize("radius", [0.05, 0.5, 3.0])
def test_the_chords_of_a_sphere_leave_it_by_less_than_two_millimetres(radius: float) -> None:
    mesh = shapes.sphere(radius)
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    assert np.linalg.norm(mesh.vertices, axis=1) == pytest.approx(radius)
    # The middle of a face feels the chords of both directions, hence twice the deviation.
    assert radius - np.linalg.norm(middles, axis=1).min() < 2 * shapes.DEVIATION


def test_normals_of_an_ellipsoid_are_its_gradient() -> None:
    radii = np.array([1.0, 2.0, 0.5])
    mesh = shapes.ellipsoid((1.0, 2.0, 0.5))
    gradient = mesh.vertices / radii**2
    gradient /= np.linalg.norm(gradient, axis=1, keepdims=True)
    assert mesh.normals == pytest.approx(gradient, abs=1e-6)  # float32


@pytest.mark.parametrize("normal", [(0, 0, 1), (1, 0, 0), (0, -1, 0), (0.3, -0.4, 0.5)])
def test_a_plane_faces_along_its_normal_and_has_its_size(normal: tuple[float, float, float]) -> None:
    body = solid(shapes.plane((4, 5), normal))
    assert body.area == pytest.approx(20)
    assert body.face_normals[0] == pytest.approx(np.asarray(normal) / np.linalg.norm(normal))


def test_a_box_wears_its_texture_upright_on_every_side() -> None:
    mesh = shapes.box((1, 1, 1))
    assert mesh.uv is not None
    corners, uv = mesh.vertices[mesh.faces], mesh.uv[mesh.faces]
    u, v = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    handedness = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    assert (handedness > 0).all()  # not mirrored on any side
    assert len(corners) == 12
