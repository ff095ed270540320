"""A world as flat arrays: the same triangles, each mesh once, and nothing that no part needs."""

from __future__ import annotations

import numpy as np

from sonar_component.render.packing import Packed, pack
from sonar_component.scene import Body, Material, Mesh, Part, World
from sonar_component.scene.shapes import box, grid_faces, sphere


def placed(name: str, *parts: Part, at: tuple[float, float, float] = (0, 0, 0)) -> Body:
    X_WB = np.eye(4)
    X_WB[:3, 3] = at
    return Body(name, list(parts), X_WB)


def plain(mesh: Mesh, reflectance: float = 1.0) -> Part:
    return Part(mesh, Material("plain", reflectance), np.eye(4))


def terrain() -> Mesh:
    x, y = np.meshgrid(np.linspace(0, 10, 70), np.linspace(0, 10, 70))
    vertices = np.stack([x.ravel(), y.ravel(), np.sin(x).ravel()], axis=1)
    return Mesh(vertices, np.tile(np.array([0, 0, 1], np.float32), (4900, 1)), grid_faces(70, 70))


def corners(packed: Packed, tile: int) -> np.ndarray:
    """(n, 3, 3) positions of the triangles that a tile draws."""
    command = packed.commands[tile]
    first, count = int(command["first_index"]), int(command["count"])
    index = packed.indices[first : first + count] + command["base_vertex"]
    return packed.vertices[index, :3].reshape(-1, 3, 3)


def as_a_set(triangles: np.ndarray) -> np.ndarray:
    return np.unique(triangles.reshape(-1, 9).astype(np.float32), axis=0)


def test_the_tiles_of_a_part_draw_its_triangles() -> None:
    meshes = [terrain(), sphere(1.0), box((1, 2, 3))]
    packed = pack(World([placed("all", *map(plain, meshes))]))
    for number, mesh in enumerate(meshes):
        drawn = np.concatenate([corners(packed, tile) for tile in np.flatnonzero(packed.tile_part == number)])
        assert len(drawn) == len(mesh.faces)
        np.testing.assert_array_equal(as_a_set(drawn), as_a_set(mesh.vertices[mesh.faces]))


def test_the_spheres_of_tiles_hold_what_they_draw() -> None:
    packed = pack(World([placed("land", plain(terrain()))]))
    for tile in range(len(packed.commands)):
        away = np.linalg.norm(corners(packed, tile).reshape(-1, 3) - packed.tile_centre[tile], axis=1)
        assert away.max() <= packed.tile_radius[tile] * (1 + 1e-6)  # float32 positions


def test_a_mesh_that_is_used_twice_is_stored_once() -> None:
    shared = sphere(0.5)
    one = pack(World([placed("a", plain(shared))]))
    two = pack(World([placed("a", plain(shared)), placed("b", plain(shared, 2.0), at=(3, 0, 0))]))
    assert len(two.vertices) == len(one.vertices)
    assert len(two.indices) == len(one.indices)
    assert len(two.commands) == 2 * len(one.commands)
    assert sorted(set(two.instances["reflectance"].tolist())) == [1.0, 2.0]
    assert sorted(set(two.instances["id"].tolist())) == [1, 2]


def test_texture_coordinates_are_stored_only_if_a_part_has_a_normal_map() -> None:
    relief = Material("relief", normal_map=np.full((4, 4, 3), 128, np.uint8))
    with_uv = box((1, 1, 1))
    assert with_uv.uv is not None
    assert pack(World([placed("a", plain(with_uv))])).vertices.shape[1] == 6
    both = pack(World([placed("a", plain(with_uv)), placed("b", Part(with_uv, relief, np.eye(4)))]))
    assert both.vertices.shape[1] == 8
    assert sorted(set(both.instances["normal_layer"].tolist())) == [0, 1]
    assert len(both.normal_maps) == 1


def test_an_empty_world_and_a_body_without_parts_pack_to_nothing() -> None:
    for world in (World(), World([placed("frame")])):
        packed = pack(world)
        assert len(packed.commands) == len(packed.indices) == len(packed.vertices) == 0
