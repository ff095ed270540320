"""Pictures laid on from six sides: true to size, upright, without mirroring."""

import numpy as np
import pytest
import trimesh

from sonar_component.scene import Body, Material, Mesh, Part, World, shapes
from sonar_component.scene.box_mapping import box_mapped
from sonar_component.scene.surface import Surface, to_mesh
from sonar_component.scene.terrain import terrain


def ball() -> Mesh:
    source = trimesh.creation.icosphere(subdivisions=4)
    return to_mesh(Surface("ball", np.array(source.vertices), np.array(source.faces)))[0]


def test_the_surface_stays_and_a_metre_of_it_is_a_metre_of_picture() -> None:
    plain = shapes.box((2, 3, 4))
    mapped = box_mapped(plain, 0.5)
    assert np.array_equal(plain.vertices[plain.faces], mapped.vertices[mapped.faces])
    assert np.array_equal(plain.normals[plain.faces], mapped.normals[mapped.faces])
    assert mapped.uv is not None
    edge = np.linalg.norm(np.diff(mapped.vertices[mapped.faces], axis=1), axis=2)
    drawn = np.linalg.norm(np.diff(mapped.uv[mapped.faces], axis=1), axis=2)
    assert drawn * 0.5 == pytest.approx(edge, rel=1e-6)  # float32


def test_no_side_is_mirrored_and_none_is_stretched_more_than_oblique_faces_must() -> None:
    mapped = box_mapped(ball(), 1.0)
    assert mapped.uv is not None
    p, t = mapped.vertices[mapped.faces], mapped.uv[mapped.faces].astype(float)
    u, v = t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]
    drawn = (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2
    area = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1) / 2
    assert drawn.min() > 0
    # The face that looks least at any side is the diagonal one: cos = 1 / sqrt(3).
    assert (drawn / area).min() > 1 / np.sqrt(3) - 1e-3


def test_a_gentle_terrain_keeps_its_vertices() -> None:
    floor = terrain(np.random.default_rng(2).random((9, 12)), (11, 8, 0.2))
    mapped = box_mapped(floor, 2.0)
    assert np.array_equal(mapped.vertices, floor.vertices)


def test_a_world_gives_texture_coordinates_to_whatever_gets_a_picture() -> None:
    mesh, relief = ball(), np.full((2, 2, 3), 128, np.uint8)
    world = World([Body("a", [Part(mesh, Material("plates", 1, relief), np.eye(4))], np.eye(4))])
    world.add(Body("b", [Part(mesh, Material("plain"), np.eye(4))], np.eye(4)))
    assert world.bodies["a"].parts[0].mesh.uv is not None
    assert world.bodies["b"].parts[0].mesh is mesh
    world.set_material("b", Material("plates", 1, relief))
    assert world.bodies["b"].parts[0].mesh is world.bodies["a"].parts[0].mesh
