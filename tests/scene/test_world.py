"""The world: names, counters, and the way to another process and back."""

import numpy as np
import pytest

from sonar_component.scene import Body, Material, Mesh, Part, World, shapes
from sonar_component.scene.pose import from_rpy


def textured() -> Material:
    relief = np.random.default_rng(5).integers(0, 255, (4, 6, 3)).astype(np.uint8)
    return Material("plates", 1.5, relief, relief[..., 0].copy())


def world() -> World:
    ball, brick = shapes.sphere(0.5), shapes.box((1, 2, 3))
    steel = textured()
    wreck = Body(
        "wreck", [Part(ball, steel, from_rpy((1, 0, 0), (0.1, 0, 0)), "bow"), Part(brick, steel, np.eye(4))], np.eye(4)
    )
    buoy = Body("buoy", [Part(ball, Material("foam", 0.4), np.eye(4))], from_rpy((5e5, 4.65e6, -3), (0, 0, 1)), True)
    return World([wreck, buoy], ["wreck.glb: 'bow': 1 x face without area, dropped"])


def test_a_description_carries_everything_and_shares_what_was_shared() -> None:
    sent = world()
    sample = sent.to_description(time=1234)
    received = World.from_description(sample)
    assert sample.time == 1234
    assert received.content_hash() == sent.content_hash()
    assert received.warnings == sent.warnings
    assert list(received.bodies) == ["wreck", "buoy"]
    assert [body.moving for body in received.bodies.values()] == [False, True]
    bow, hull = received.bodies["wreck"].parts
    assert (bow.name, bow.material) == ("bow", hull.material)
    assert bow.mesh is received.bodies["buoy"].parts[0].mesh
    for a, b in zip(sent.bodies.values(), received.bodies.values(), strict=True):
        assert np.array_equal(a.X_WB, b.X_WB)
        for p, q in zip(a.parts, b.parts, strict=True):
            assert np.array_equal(p.X_BM, q.X_BM)
            assert np.array_equal(p.mesh.vertices, q.mesh.vertices)
            assert np.array_equal(p.mesh.normals, q.mesh.normals)
            assert np.array_equal(p.mesh.faces, q.mesh.faces)
            assert (p.material.name, p.material.reflectance) == (q.material.name, q.material.reflectance)
            for ours, theirs in (
                (p.material.normal_map, q.material.normal_map),
                (p.material.reflectance_map, q.material.reflectance_map),
            ):
                assert (ours is None) == (theirs is None)
                assert ours is None or np.array_equal(ours, theirs)


def test_every_field_of_a_description_is_a_scalar_a_text_or_a_numeric_array() -> None:
    for name, value in vars(world().to_description()).items():
        assert isinstance(value, (int, str, np.ndarray)), name
        assert not isinstance(value, np.ndarray) or value.dtype.kind in "iuf", name


def test_an_empty_world_can_be_described() -> None:
    assert World.from_description(World().to_description()).bodies == {}


def test_a_damaged_description_is_refused() -> None:
    sample = world().to_description()
    sample.vertices = sample.vertices + 1e-9
    with pytest.raises(ValueError, match="content hash does not match"):
        World.from_description(sample)


def test_arrays_that_contradict_each_other_are_refused_by_name() -> None:
    sample = world().to_description()
    sample.part_mesh = sample.part_mesh[:-1]
    with pytest.raises(ValueError, match=r"SceneDescription.part_mesh must have 3 rows, got 2"):
        World.from_description(sample)


def test_a_pose_moves_the_pose_counter_only() -> None:
    w = world()
    geometry, pose, content = w.geometry_version, w.pose_version, w.content_hash()
    w.set_pose("buoy", from_rpy((1, 2, 3), (0, 0, 0)))
    assert (w.geometry_version, w.pose_version) == (geometry, pose + 1)
    assert w.content_hash() == content
    assert w.bodies["buoy"].X_WB[:3, 3].tolist() == [1, 2, 3]


def test_a_static_body_that_is_moved_becomes_a_moving_one() -> None:
    w = world()
    geometry = w.geometry_version
    w.set_pose("wreck", np.eye(4))
    assert w.bodies["wreck"].moving
    assert w.geometry_version > geometry


def test_adding_removing_and_a_new_material_move_the_geometry_counter_and_the_hash() -> None:
    w = world()
    seen = {(w.geometry_version, w.content_hash())}
    w.add(Body("crate", [Part(shapes.box((1, 1, 1)), Material("wood"), np.eye(4))], np.eye(4)))
    seen.add((w.geometry_version, w.content_hash()))
    w.set_material("wreck", Material("rust", 0.8), part="bow")
    seen.add((w.geometry_version, w.content_hash()))
    w.remove("crate")
    seen.add((w.geometry_version, w.content_hash()))
    assert len({version for version, _ in seen}) == len({content for _, content in seen}) == 4
    assert [part.material.reflectance for part in w.bodies["wreck"].parts] == [0.8, 1.5]


def test_an_unknown_body_is_refused_with_the_nearest_name() -> None:
    w = world()
    for act in (
        lambda: w.set_pose("wrekc", np.eye(4)),
        lambda: w.remove("wrekc"),
        lambda: w.set_material("wrekc", textured()),
    ):
        with pytest.raises(ValueError, match="no body 'wrekc'; did you mean 'wreck'"):
            act()
    with pytest.raises(ValueError, match="no body 'x'; bodies: buoy, wreck"):
        w.body("x")
    with pytest.raises(ValueError, match="body 'wreck' has no part 'stern'; parts: , bow"):
        w.set_material("wreck", textured(), part="stern")


@pytest.mark.parametrize(
    ("X", "reason"),
    [
        (np.full((4, 4), np.nan), "NaN"),
        (np.diag([2.0, 1, 1, 1]), "rotation and a translation"),
        (np.diag([-1.0, 1, 1, 1]), "rotation and a translation"),
        (np.eye(3), "4 x 4"),
    ],
)
def test_what_is_not_a_pose_is_refused_and_changes_nothing(X: np.ndarray, reason: str) -> None:
    w = world()
    before = w.bodies["buoy"].X_WB.copy()
    with pytest.raises(ValueError, match=f"pose of 'buoy'.*{reason}"):
        w.set_pose("buoy", X)
    assert np.array_equal(w.bodies["buoy"].X_WB, before)


def test_poses_travel_without_the_meshes_and_only_to_the_same_world() -> None:
    here, there = world(), World.from_description(world().to_description())
    here.set_pose("buoy", from_rpy((7, 8, 9), (0.1, 0.2, 0.3)))
    there.apply_poses(here.body_poses(time=5))
    assert np.array_equal(there.bodies["buoy"].X_WB, here.bodies["buoy"].X_WB)
    assert not there.bodies["wreck"].moving  # it did not move
    there.remove("wreck")
    with pytest.raises(ValueError, match="content hash differs"):
        there.apply_poses(here.body_poses(time=6))


def test_a_taken_name_is_refused() -> None:
    w = world()
    with pytest.raises(ValueError, match="already has a body 'buoy'"):
        w.add(Body("buoy", [], np.eye(4)))


@pytest.mark.parametrize("reflectance", [0, -1, np.nan, np.inf])
def test_a_reflectance_that_is_not_greater_than_zero_is_refused(reflectance: float) -> None:
    with pytest.raises(ValueError, match="material 'x': reflectance must be greater than 0"):
        Material("x", reflectance)


def test_meshes_cannot_be_changed_behind_a_renderers_back() -> None:
    with pytest.raises(ValueError, match="read-only"):
        shapes.sphere(1).vertices[0] = 0


def test_faces_that_are_not_finite_are_counted_by_object_and_once() -> None:
    ball = shapes.sphere(1)
    vertices = ball.vertices.copy()
    vertices[40] = np.nan
    count = int((ball.faces == 40).any(axis=1).sum())
    broken = Mesh(vertices, ball.normals.copy(), ball.faces.copy())
    w = World([Body("buoy", [Part(broken, Material("x"), np.eye(4))], np.eye(4))])
    assert w.warnings == [f"'buoy': {count} x face with NaN or infinite vertices, left out"]
    assert World.from_description(w.to_description()).warnings == w.warnings


def test_a_part_that_is_mirrored_or_stretched_is_refused_by_name() -> None:
    for scale in ((-1, 1, 1), (2, 2, 2)):
        part = Part(shapes.box((1, 1, 1)), Material("steel"), np.diag([*scale, 1.0]), "lid")
        with pytest.raises(ValueError, match="pose of 'lid of chest' must be a rotation and a translation"):
            World([Body("chest", [part], np.eye(4))])
