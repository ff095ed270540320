"""What is drawn: no tile that a view sees is left out, and of closed shells only what faces the sonar."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from sonar_component.render.draws import Sight, choose
from sonar_component.render.footprints import FootprintRenderer, Optics
from sonar_component.render.layout import build_layout
from sonar_component.render.packing import Packed, pack
from sonar_component.scene import Body, Material, Mesh, Part, World
from sonar_component.scene.shapes import box, plane, sphere


def spheres(centres: np.ndarray, radii: np.ndarray) -> Packed:
    """Open tiles with these spheres around them."""
    count = len(radii)
    world = World(
        [Body("sheets", [Part(plane((1, 1)), Material("plain"), np.eye(4)) for _ in range(count)], np.eye(4))]
    )
    packed = pack(world)
    assert len(packed.tile_radius) == count
    packed.tile_centre[:], packed.tile_radius[:] = centres, radii
    return packed


def seen(packed: Packed, sight: Sight, X_SM: np.ndarray | None = None) -> np.ndarray:
    """(views, tiles) bool."""
    parts = int(packed.tile_part.max()) + 1
    draws = choose(packed, np.tile(np.eye(4), (parts, 1, 1)) if X_SM is None else X_SM, sight)
    made = np.zeros((len(sight.azimuths), len(packed.commands)), np.bool_)
    made[draws.views, draws.tiles] = True
    assert made.sum() == len(draws.tiles) == draws.counts.sum()
    return made


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
    made = seen(spheres(centres, radii), Sight(azimuths, half, tangent, 0.01, range_max))
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
    made = seen(spheres(centres, radii), Sight(np.zeros(1), np.radians(10), np.tan(np.radians(10)), 0.01, 30.0))[0]
    depth, side = centres[:, 0], np.abs(centres[:, 1])
    # Twice the radius around the view's planes; a sphere touches a corner only where it is nearer.
    loose = (depth > -1) & (side < (depth + 6) * np.tan(np.radians(10)) + 1) & (np.linalg.norm(centres, axis=1) < 31)
    assert not made[~loose].any()


def test_a_sphere_around_the_sonar_is_seen_by_every_view() -> None:
    made = seen(spheres(np.zeros((1, 3)), np.ones(1)), Sight(np.radians([-180.0, -90, 0, 90]), 0.2, 0.1, 0.01, 30.0))
    assert made.all()


AHEAD = Sight(np.zeros(1), np.radians(40), float(np.tan(np.radians(40))), 0.01, 30.0)


def at(x: float, y: float = 0.0, z: float = 0.0) -> np.ndarray:
    """A pose without rotation."""
    X = np.eye(4)
    X[:3, 3] = x, y, z
    return X


def alone(*meshes: Mesh) -> Packed:
    return pack(World([Body("all", [Part(mesh, Material("plain"), np.eye(4)) for mesh in meshes], np.eye(4))]))


def test_of_a_ball_the_tiles_on_its_far_side_are_left_out_and_none_that_faces_the_sonar() -> None:
    packed = alone(sphere(1.5, deviation=2e-4))
    made = seen(packed, AHEAD, at(8.0)[None])[0]
    for tile, command in enumerate(packed.commands):
        index = packed.indices[command["first_index"] : command["first_index"] + command["count"]]
        a, b, c = packed.vertices[index, :3].reshape(-1, 3, 3).transpose(1, 0, 2).astype(np.float64)
        facing = (np.cross(b - a, c - a) * (a + np.array([8.0, 0, 0]))).sum(axis=1) < 0
        assert made[tile] or not facing.any()
    assert 0.4 < made.mean() < 0.6  # (1 - 1.5 / 8) / 2 of a ball are seen from there; tiles crossing that edge stay


@pytest.mark.parametrize(
    ("place", "closed"),
    [((8.0, 0, 0), True), ((0.5, 0, 0), False), ((1.515, 0, 0), False), ((1.6, 0, 0), True)],
    ids=["outside", "inside", "within a corner of the near plane", "just outside"],
)
def test_back_faces_are_left_out_only_where_the_sonar_is_outside(place: Any, closed: bool) -> None:
    draws = choose(alone(sphere(1.5)), at(*place)[None], AHEAD)
    assert draws.counts.tolist() == ([0, 0, len(draws.tiles), 0] if closed else [0, 0, 0, len(draws.tiles)])
    assert len(draws.tiles)


def half_ball() -> Mesh:
    whole = sphere(1.0)
    kept = whole.faces[(whole.vertices[whole.faces][:, :, 2] >= -1e-9).all(axis=1)]
    return Mesh(whole.vertices, whole.normals, kept, whole.uv)


def turned(mesh: Mesh) -> Mesh:
    return Mesh(mesh.vertices, mesh.normals, np.ascontiguousarray(mesh.faces[:, ::-1]), mesh.uv)


def joined(*meshes: Mesh) -> Mesh:
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, first[:-1], strict=True)]
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.normals for mesh in meshes]),
        np.concatenate(faces).astype(np.int32),
    )


def moved(mesh: Mesh, by: Sequence[float]) -> Mesh:
    return Mesh(mesh.vertices + np.asarray(by), mesh.normals, mesh.faces)


SCENES = {
    "ball": sphere(1.5),
    "ball wound inwards": turned(sphere(1.5)),
    "box": box((2, 2, 2)),
    "open bowl": moved(half_ball(), (0, 0, -0.4)),
    "bowl and inverted box in one mesh": joined(
        moved(half_ball(), (0, -1.5, -0.4)), turned(moved(box((1, 1, 1)), (0, 1.5, 0)))
    ),
    "room around the sonar": box((30, 30, 10)),
}


@pytest.mark.parametrize("mesh", SCENES.values(), ids=SCENES.keys())
def test_samples_are_the_same_with_and_without_back_faces(context: Any, mesh: Mesh) -> None:
    layout = build_layout(-np.radians(40), np.radians(40), np.radians(20), np.radians(0.3), 128, 0.25)
    renderer = FootprintRenderer(context)
    drawn = []
    for closed in (True, False):
        world = World(
            [
                Body(
                    "all",
                    [Part(mesh, Material("plain"), np.eye(4))],
                    at(6.0 if mesh is not SCENES["room around the sonar"] else 0.0),
                )
            ]
        )
        renderer.geometry.update(world)
        if not closed:
            renderer.geometry.packed.tile_hull[:] = np.nan
        renderer.draw(at(0, 0, 0.7), layout, Optics(30.0, 0.1))
        drawn.append(renderer.read().copy())
    renderer.release()
    used = layout.solid_angle > 0
    assert (drawn[0][:, :, 0] > 0)[used].mean() > 0.02
    # Where a silhouette passes through the very centre of a cell, either side may have it.
    differ = (drawn[0] != drawn[1]).any(axis=2)[used].mean()
    assert differ < 1e-4


@pytest.mark.parametrize("up", [20, 60, 75])
def test_a_shell_that_the_near_plane_cuts_open_is_drawn_from_both_sides(context: Any, up: float) -> None:
    layout = build_layout(-np.radians(30), np.radians(30), np.radians(up), np.radians(1), 128, 0.25)
    renderer = FootprintRenderer(context)
    renderer.geometry.update(World([Body("box", [Part(box((2, 2, 2)), Material("plain"), np.eye(4))], np.eye(4))]))
    packed, used = renderer.geometry.packed, layout.solid_angle > 0
    hull = packed.tile_hull.copy()
    for height in np.linspace(1.0, 1.08, 17):  # to 5 near planes above the roof
        X_WS = at(0.3, -0.2, height)
        c, s = np.sin(np.radians(up)), np.cos(np.radians(up))  # the lower edge of the aperture points straight down
        X_WS[:3, :3] = [[c, 0, s], [0, 1, 0], [-s, 0, c]]
        drawn = []
        for boxes in (hull, np.nan):
            packed.tile_hull[:] = boxes
            renderer.draw(X_WS, layout, Optics(30.0, 0.1))
            drawn.append(renderer.read().copy())
        packed.tile_hull[:] = hull
        assert (drawn[0] != drawn[1]).any(axis=2)[used].mean() < 1e-3  # edges that pass through a cell's centre
    renderer.release()
