"""Patches of a terrain in coarser versions: closed, true to their errors, and without cracks between them."""

import numpy as np
import pytest

from sonar_component.scene import Body, Material, Mesh, Part, World, shapes
from sonar_component.scene.levels import STRIDES, coarsest, error_table, patches
from sonar_component.scene.terrain import terrain


def rolling(rows: int = 61, columns: int = 80) -> Mesh:
    y, x = np.mgrid[0:rows, 0:columns]
    return terrain(np.sin(x / 9) * np.cos(y / 7) + 0.1 * np.sin(x * 2.1), (80.0, 60.0, 2.0))


def edges(faces: np.ndarray) -> np.ndarray:
    return faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)


def test_the_finest_versions_together_are_the_mesh() -> None:
    mesh = rolling()
    finest = np.concatenate([patch.faces[0] for patch in patches(mesh)])
    assert {tuple(sorted(face)) for face in finest.tolist()} == {tuple(sorted(face)) for face in mesh.faces.tolist()}
    assert len(finest) == len(mesh.faces)


def test_any_mix_of_versions_covers_the_floor_once_and_has_no_cracks() -> None:
    mesh = rolling()
    rng = np.random.default_rng(4)
    made = patches(mesh)
    faces = np.concatenate([patch.faces[rng.integers(len(patch.faces))] for patch in made])
    a, b, c = (mesh.vertices[faces[:, k], :2] for k in range(3))
    area = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    assert area.min() > 0  # every face looks up
    assert area.sum() == pytest.approx(80 * 60)
    # Without cracks every edge is met by its opposite, but for those around the terrain.
    sides = {tuple(edge) for edge in edges(faces).tolist()}
    assert len(sides) == 3 * len(faces)
    alone = [edge for edge in sides if edge[::-1] not in sides]
    x, y = mesh.vertices[np.array(alone)][..., 0], mesh.vertices[np.array(alone)][..., 1]
    on_rim = (np.abs(x) == 40).all(axis=1) | (np.abs(y) == 30).all(axis=1)
    assert on_rim.all()


def test_the_error_of_a_version_is_its_greatest_distance_in_height() -> None:
    mesh = rolling()
    patch = patches(mesh)[1]
    for faces, error in zip(patch.faces, patch.errors, strict=True):
        inside = np.unique(patch.faces[0])
        worst = 0.0
        for p in mesh.vertices[inside]:  # a plain search for the triangle above each height
            a, b, c = (mesh.vertices[faces[:, k]] for k in range(3))
            u, v, w = b - a, c - a, p - a
            d = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
            s = (w[:, 0] * v[:, 1] - w[:, 1] * v[:, 0]) / d
            t = (u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0]) / d
            hit = np.flatnonzero((s > -1e-9) & (t > -1e-9) & (s + t < 1 + 1e-9))[0]
            worst = max(worst, abs(a[hit, 2] + s[hit] * u[hit, 2] + t[hit] * v[hit, 2] - p[2]))
        assert error == pytest.approx(worst, abs=1e-9)
    assert patch.errors[0] == pytest.approx(0, abs=1e-12)


def test_the_coarsest_version_needs_a_tenth_of_the_triangles() -> None:
    patch = patches(rolling())[0]
    assert len(patch.faces) == len(STRIDES)
    assert len(patch.faces[-1]) < 0.12 * len(patch.faces[0])


def test_a_flat_floor_is_as_good_when_coarse() -> None:
    table = error_table(patches(terrain(np.full((49, 49), 0.7), (10, 10, 1))))
    assert table.max() < 1e-12  # rounding of the weights


def test_the_coarsest_version_that_is_good_enough_is_chosen() -> None:
    errors = np.array([[0, 0.01, 0.1, 1.0], [0, 0.01, np.inf, np.inf], [1e-16, 0.5, 0.6, 0.7]])
    assert coarsest(errors, np.array([0.1, 9.0, 0.0])).tolist() == [2, 1, 0]


def test_small_terrains_have_only_the_versions_that_fit() -> None:
    made = patches(terrain(np.zeros((3, 3)), (1, 1, 1)))
    assert [len(patch.faces) for patch in made] == [1]
    table = error_table(made)
    assert table[0, 0] == 0
    assert np.isinf(table[0, 1:]).all()


def test_other_meshes_have_no_patches_and_terrains_keep_theirs_on_the_way_to_another_process() -> None:
    assert patches(shapes.sphere(1)) == []
    mesh = rolling()
    world = World([Body("floor", [Part(mesh, Material("sand"), np.eye(4))], np.eye(4))])
    assert World.from_description(world.to_description()).bodies["floor"].parts[0].mesh.grid == mesh.grid
