"""What materials do to samples: reflectances and their maps against closed forms, and that plain scenes pay nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from sonar_component.render.footprints import FootprintRenderer, Optics, decode, strength_max
from sonar_component.render.layout import build_layout
from sonar_component.render.packing import instance_type, pack
from sonar_component.scene import Body, Material, Part, World
from sonar_component.scene.shapes import sphere
from tests.reference.rays import directions
from tests.reference.scenes import plate, world

DEG = np.pi / 180
PLAIN = Optics(range_max=30.0, bin_length=0.1)
FAN = build_layout(-30 * DEG, 30 * DEG, 10 * DEG, 0.5 * DEG, 64, 0.25)
INSIDE = FAN.solid_angle > 0
UPRIGHT = [[1, 0], [0, 0], [0, 1], [1, 1]]  # of plate(): u to the right, v up
ROOT_16 = 2e-5  # [-], the root of the strength has 16 bits: 1 / 65535 of its own size and more

Draw = Callable[..., np.ndarray]


@pytest.fixture
def renderer(context: Any) -> Iterator[FootprintRenderer]:
    made = FootprintRenderer(context)
    yield made
    made.release()


@pytest.fixture
def draw(renderer: FootprintRenderer) -> Draw:
    """Strengths of the samples of a world, (columns, rows)."""

    def draw_(scene: World, X_WS: Any = None) -> np.ndarray:
        renderer.geometry.update(scene)
        renderer.draw(np.eye(4) if X_WS is None else X_WS, FAN, PLAIN)
        return decode(renderer.read().copy(), strength_max(PLAIN, renderer.geometry.reflectance_max))[0]

    return draw_


def turned(yaw: float, pitch: float, distance: float) -> np.ndarray:
    """A sonar that looks at the origin from that distance."""
    c, s = np.cos(yaw), np.sin(yaw)
    Rz = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    c, s = np.cos(pitch), np.sin(pitch)
    X = np.eye(4)
    X[:3, :3] = Rz @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    X[:3, 3] = -distance * X[:3, 0]
    return X


@pytest.mark.parametrize("R", [0.1, 0.35, 0.999, 1.4, 2.12, 10.0])
@pytest.mark.parametrize("view", [(0, 0, 6), (2.1, 0.4, 9), (-1.2, -0.9, 4)])
def test_reflectance_scales_every_echo_by_the_same_factor_from_anywhere(
    draw: Draw, R: float, view: tuple[float, float, float]
) -> None:
    """Fault 15 of the peers: there R > 1 was added where R < 1 was multiplied, and depended on the view."""
    ball = sphere(1.5)
    one, other = (draw(world(ball, material=Material("m", r)), turned(*view)) for r in (1.0, R))
    lit = (one > 0.05) & INSIDE
    assert lit.sum() > 100
    # Both strengths are stored as roots of 16 bits of the greatest one: 2 / 65535 / sqrt(strength / greatest).
    np.testing.assert_allclose(other[lit] / one[lit], R, rtol=4 / 65535 / np.sqrt(0.05 / max(R, 1)) + 1e-6)
    assert float((other * FAN.solid_angle).sum() / (one * FAN.solid_angle).sum()) == pytest.approx(R, rel=1e-4)


def test_a_reflectance_map_mutes_where_it_is_dark(draw: Draw) -> None:
    """A picture of four grey squares on a plate across the fan, read at each ray's own place on it."""
    squares = np.array([[255, 128], [51, 0]], np.uint8)  # first row on top
    image = np.kron(squares, np.ones((64, 64), np.uint8))
    mesh = plate(8.0, 12.0, 4.0, uv=UPRIGHT)
    strength = draw(world(mesh, material=Material("m", 0.8, reflectance_map=image)))
    rays = directions(FAN)
    u, v = 0.5 - rays[..., 1] / rays[..., 0] * 8 / 12, 0.5 + rays[..., 2] / rays[..., 0] * 8 / 4
    expected = 0.8 * rays[..., 0] * squares[np.where(v > 0.5, 0, 1), np.where(u > 0.5, 1, 0)] / 255.0
    # Between squares the picture is blended, over a texel and more where it is seen from afar.
    clear = INSIDE & (np.abs(u - 0.5) > 0.04) & (np.abs(v - 0.5) > 0.04)
    clear &= (np.abs(u - 0.5) < 0.46) & (np.abs(v - 0.5) < 0.46)
    assert clear.sum() > 1000
    np.testing.assert_allclose(strength[clear], expected[clear], atol=ROOT_16)


def test_a_fine_reflectance_map_seen_from_afar_keeps_its_energy(draw: Draw) -> None:
    """A chequer board far finer than the samples answers like its mean grey, not like single squares."""
    y, x = np.mgrid[0:256, 0:256]
    board = np.where((x + y) % 2 == 0, 255, 0).astype(np.uint8)
    mesh = plate(8.0, 30.0, 30.0, uv=UPRIGHT)
    flat = draw(world(mesh))
    strength = draw(world(mesh, material=Material("m", reflectance_map=board)))
    # 127.5 rounds to 127 or 128 in the smaller versions of the picture; a texel is 0.12 m, a sample 0.04 to 0.1 m, so
    # single samples still show squares, and only the sum is compared.
    total = float((strength * FAN.solid_angle).sum() / (flat * FAN.solid_angle).sum())
    assert total == pytest.approx(0.5, abs=0.01)


def test_maps_of_many_parts_do_not_mix(draw: Draw) -> None:
    """Left: half reflectance by map. Middle: a relief. Right: nothing. Each as if it stood alone."""
    grey, big = np.full((4, 4), 128, np.uint8), np.full((16, 8), 51, np.uint8)
    tilt = np.broadcast_to(np.array([128 + 76, 128, 128 + 102], np.uint8), (4, 4, 3))  # 0.6, 0, 0.8
    materials = [
        Material("grey", reflectance_map=grey),
        Material("tilt", normal_map=tilt.copy()),
        Material("plain"),
        Material("both", 2.0, tilt.copy(), big),
    ]
    places = [2.7, 0.9, -0.9, -2.7]
    meshes = [plate(8.0, 1.6, 2.0, y=y, uv=UPRIGHT) for y in places]
    bodies = [Body(m.name, [Part(mesh, m, np.eye(4))], np.eye(4)) for m, mesh in zip(materials, meshes, strict=True)]
    together = draw(World(bodies))
    for material, mesh in zip(materials, meshes, strict=True):
        alone = draw(world(mesh, material=material))
        lit = INSIDE & (alone > 0)
        assert lit.sum() > 100
        # Alone and together differ in the size of the texture array and in the greatest strength only.
        np.testing.assert_allclose(together[lit], alone[lit], atol=2 * ROOT_16)
    grey_lit = INSIDE & (draw(world(meshes[0])) > 0)
    np.testing.assert_allclose(together[grey_lit], (directions(FAN)[..., 0] * 128 / 255)[grey_lit], atol=ROOT_16)


@pytest.mark.parametrize("stretch", [(1.0, 1.0), (5.0, 1.0), (0.2, 3.0)])
@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("angle", [0.0, 37.0, 90.0, 200.0])
def test_a_turned_mirrored_and_stretched_picture_tilts_along_its_own_axes(
    draw: Draw, stretch: tuple[float, float], mirrored: bool, angle: float
) -> None:
    """Tangent along u, bitangent along v, both unit however the picture is stretched: MikkTSpace's frame."""
    c, s = np.cos(angle * DEG), np.sin(angle * DEG)
    corner = np.array(UPRIGHT) - 0.5
    uv = corner @ np.array([[c, s], [-s, c]]) * stretch * ([-1, 1] if mirrored else [1, 1])
    tilt = np.array([0.3, -0.4])
    image = np.array([*tilt, np.sqrt(1 - tilt @ tilt)]) * 127 + 128
    relief = Material("m", normal_map=np.broadcast_to(np.rint(image).astype(np.uint8), (4, 4, 3)).copy())
    strength = draw(world(plate(8.0, 30.0, 30.0, uv=uv), material=relief))
    # uv = corner R S: u grows along the first column of R, which for these corners is (right, up).
    right, up = np.array([0, -1, 0]), np.array([0, 0, 1])
    along_u = (c * right - s * up) * (-1 if mirrored else 1)
    along_v = s * right + c * up
    z = np.sqrt(1 - tilt @ tilt)
    normal = tilt[0] * along_u + tilt[1] * along_v + z * np.array([-1, 0, 0])
    # 8 bits of each of three components: half of 1/127, and the length that the rounded normal loses.
    np.testing.assert_allclose(strength[INSIDE], np.abs(directions(FAN) @ normal)[INSIDE], atol=0.01)


def test_a_flat_normal_map_changes_nothing(draw: Draw) -> None:
    flat = Material("m", normal_map=np.broadcast_to(np.array([128, 128, 255], np.uint8), (4, 4, 3)).copy())
    ball = sphere(1.5)
    X_WS = turned(0.3, 0.2, 6)
    # 128 is exactly zero: what is left is one more normalisation in float32, which may round to the next step.
    np.testing.assert_allclose(draw(world(ball, material=flat), X_WS), draw(world(ball), X_WS), atol=2 * ROOT_16)


def test_a_scene_without_pictures_has_no_column_for_them() -> None:
    names = instance_type().names
    assert names is not None
    assert not [name for name in names if "layer" in name]
    picture = np.full((2, 2), 9, np.uint8)
    packed = pack(world(plate(8.0, 1.0, 1.0, uv=UPRIGHT), material=Material("m", reflectance_map=picture)))
    assert packed.has_reflectance_maps
    assert not packed.has_normal_maps
    assert packed.instances.dtype.itemsize == instance_type().itemsize + 4
    assert packed.vertices.shape[1] == 8
    assert pack(world(plate(8.0, 1.0, 1.0, uv=UPRIGHT))).vertices.shape[1] == 6


def test_sonars_of_one_context_share_what_is_loaded_and_move_their_own_bodies(context: Any) -> None:
    described = world(sphere(1.0), material=Material("m", 2.0)).to_description()
    here, there = World.from_description(described), World.from_description(described)
    one, other = FootprintRenderer(context), FootprintRenderer(context)
    one.geometry.update(here)
    other.geometry.update(there)
    loaded = one.geometry.loaded
    assert loaded is not None
    assert loaded is other.geometry.loaded
    assert loaded.users == 2
    X = np.eye(4)
    X[0, 3] = 7.0
    here.set_pose("body0", X)  # a static one becomes a moving one: the geometry counter grows, the content does not
    X[0, 3] = 11.0
    there.set_pose("body0", X)
    nearest = []
    for renderer, scene in ((one, here), (other, there), (one, here)):
        renderer.geometry.update(scene)
        renderer.draw(np.eye(4), FAN, PLAIN)
        ranges = decode(renderer.read(), 2.0)[1]
        nearest.append(float(ranges[ranges > 0].min()))
    np.testing.assert_allclose(nearest, [6, 10, 6], atol=0.01)  # DEVIATION of the sphere's chords: 2 mm
    assert one.geometry.loaded is loaded
    assert loaded.users == 2
    one.release()
    assert loaded.users == 1
    other.draw(np.eye(4), FAN, PLAIN)
    assert decode(other.read(), 2.0)[1].any()
    other.release()
    assert loaded.users == 0
    assert not context.extra["loaded_worlds"]


def test_a_new_material_is_drawn_from_the_next_image_on(draw: Draw) -> None:
    scene = world(plate(8.0, 30.0, 30.0))
    before = draw(scene)
    scene.set_material("body0", Material("soft", 0.25))
    np.testing.assert_allclose(draw(scene)[INSIDE], 0.25 * before[INSIDE], atol=ROOT_16)
    scene.remove("body0")
    assert not draw(scene).any()


def test_a_part_without_pictures_is_drawn_by_the_program_without_them(draw: Draw, renderer: FootprintRenderer) -> None:
    relief = Material("m", normal_map=np.random.default_rng(3).integers(90, 166, (8, 8, 3)).astype(np.uint8))
    left, right = plate(8.0, 1.6, 2.0, y=2.0, uv=UPRIGHT), plate(8.0, 1.6, 2.0, y=-2.0, uv=UPRIGHT)
    alone = draw(world(right))
    parts = [Part(left, relief, np.eye(4)), Part(right, Material("plain"), np.eye(4))]
    both = draw(World([Body("both", parts, np.eye(4))]))
    assert [set(features) - {"WIDE_FAN"} for features in renderer.programs] == [set(), {"NORMAL_MAP", "TEXTURED"}]
    np.testing.assert_array_equal(both[alone > 0], alone[alone > 0])  # to the bit: the same program drew it
    assert (both > 0).sum() > 1.9 * (alone > 0).sum()
