"""What the shader writes, sample by sample, against rays in float64; and that nothing is there that is not in use."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from sonar_component.gl.program import load_source
from sonar_component.render.footprints import FootprintRenderer, Optics, decode, near_plane, strength_max
from sonar_component.render.layout import Layout, build_layout
from sonar_component.scene import Body, Material, Mesh, Part, World
from sonar_component.scene.shapes import box, sphere
from tests.reference.rays import directions, first_hits
from tests.reference.scenes import STANDARD, floor, plate, rectangle, tilted_wall, wall, world

DEG = np.pi / 180
PLAIN = Optics(range_max=30.0, bin_length=0.1)
FAN = build_layout(-30 * DEG, 30 * DEG, 10 * DEG, 0.5 * DEG, 64, 0.25)
AT_ORIGIN = np.eye(4)
# The plain loop takes its time over triangles.
COARSE = [STANDARD[0], (sphere(1.5, deviation=0.1), (12, -3, 1.5)), STANDARD[2]]


@pytest.fixture
def renderer(context: Any) -> Iterator[FootprintRenderer]:
    made = FootprintRenderer(context)
    yield made
    made.release()


Draw = Callable[..., tuple[np.ndarray, np.ndarray, np.ndarray]]


@pytest.fixture
def draw(renderer: FootprintRenderer) -> Draw:
    """Strengths, ranges and extents of the samples of a world."""

    def draw_(
        scene: World, layout: Layout = FAN, optics: Optics = PLAIN, X_WS: np.ndarray = AT_ORIGIN
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        renderer.geometry.update(scene)
        renderer.draw(X_WS, layout, optics)
        pixels = renderer.read().copy()
        strength, ranges = decode(pixels, strength_max(optics, renderer.geometry.reflectance_max))
        extents = ((pixels[:, :, 1] >> 16 & 0x7FFF) / 32767.0) ** 2 * 1.9 * ranges
        return strength, ranges, extents

    return draw_


def triangles(scene: World, X_WS: np.ndarray = AT_ORIGIN) -> np.ndarray:
    """(n, 3, 3) in the sonar's frame."""
    out = []
    for body in scene.bodies.values():
        for part in body.parts:
            X_SM = np.linalg.inv(X_WS) @ body.X_WB @ part.X_BM
            out.append((part.mesh.vertices @ X_SM[:3, :3].T + X_SM[:3, 3])[part.mesh.faces])
    return np.concatenate(out)


def standing(pitch: float = 15 * DEG, height: float = 3.0) -> np.ndarray:
    X_WS = np.eye(4)
    X_WS[:3, :3] = [[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]]
    X_WS[2, 3] = height
    return X_WS


LAYOUTS = {
    "one view": build_layout(-5 * DEG, 5 * DEG, 10 * DEG, 0.5 * DEG, 40, 0.0),
    "sheared": FAN,
    "wide": build_layout(-65 * DEG, 65 * DEG, 6 * DEG, 1.0 * DEG, 32, 0.5),
    "full turn": build_layout(-180 * DEG, 180 * DEG, 20 * DEG, 2.0 * DEG, 32, 0.25),
    "tall": build_layout(-20 * DEG, 20 * DEG, 60 * DEG, 1.0 * DEG, 96, 0.25),
}


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS.keys())
def test_each_sample_is_the_first_hit_of_the_ray_through_its_cell(draw: Draw, layout: Layout) -> None:
    scene, X_WS = world(*COARSE), standing()
    _, ranges, _ = draw(scene, layout, PLAIN, X_WS)
    truth, _ = first_hits(triangles(scene, X_WS), directions(layout))
    heard = np.where((truth < 30.0) & (layout.solid_angle > 0), truth, 0.0)
    drawn = np.where(layout.solid_angle > 0, np.where(ranges < 30.0, ranges, 0), 0)
    off = np.abs(drawn - heard) > 2e-4 * np.maximum(heard, 1)  # float32 positions of planes that reach 140 m away
    # The rasteriser snaps corners to 1/256 of a cell: at an edge, that share of the cells may fall to the other side.
    assert off.mean() < 1 / 256
    assert (heard > 0).mean() > 0.1


def test_a_sample_of_a_plane_has_the_range_and_the_cosine_of_its_ray(draw: Draw) -> None:
    scene = world(tilted_wall(8.0, 35 * DEG))
    strength, ranges, _ = draw(scene)
    rays = directions(FAN)
    normal = np.array([-np.cos(35 * DEG), np.sin(35 * DEG), 0])
    truth = -8.0 * np.cos(35 * DEG) / (rays @ normal)
    seen = (ranges > 0) & (FAN.solid_angle > 0)
    assert seen.sum() == ((truth < 1.2 * 30.0) & (FAN.solid_angle > 0)).sum()
    np.testing.assert_allclose(ranges[seen], truth[seen], rtol=1e-5)  # float32 interpolation over 640 m of wall
    # The root of the strength has 16 bits: 1 / 65535 of its own size and more.
    np.testing.assert_allclose(strength[seen], np.abs(rays @ normal)[seen], atol=2e-5)


@pytest.mark.parametrize("tilt", [0, 20, 45], ids=lambda v: f"{v} deg")
def test_the_extent_is_what_the_plane_spans_over_a_cell(draw: Draw, tilt: float) -> None:
    scene = world(tilted_wall(8.0, tilt * DEG))
    _, ranges, extents = draw(scene)
    tiles = triangles(scene)
    (far_right, _), (far_left, _) = (first_hits(tiles, directions(FAN, right=s)) for s in (0.5, -0.5))
    (top, _), (bottom, _) = (first_hits(tiles, directions(FAN, up=s)) for s in (0.5, -0.5))
    inner = (FAN.solid_angle > 0) & (ranges > 0) & (ranges < 30) & np.isfinite(far_right + far_left + top + bottom)
    truth = np.hypot(far_right - far_left, top - bottom)
    # Differences are taken over pairs of cells, one to a side: over half a cell the slope of the range changes by
    # that much. 15 bits of the root hold a millimetre of 30 m to 0.5 %.
    (right2, _), (left2, _) = (first_hits(tiles, directions(FAN, right=s)) for s in (1.0, -1.0))
    (top2, _), (bottom2, _) = (first_hits(tiles, directions(FAN, up=s)) for s in (1.0, -1.0))
    curvature = np.abs(right2 + left2 - 2 * ranges) + np.abs(top2 + bottom2 - 2 * ranges)
    allowed = 0.01 * truth + 2 * curvature + 2e-4
    assert (np.abs(extents - truth) <= allowed)[inner].all()


def test_the_mean_extent_of_a_floor_is_that_of_its_ranges(draw: Draw) -> None:
    scene, X_WS = world(floor(5.0)), standing(15 * DEG, 0.0)
    layout = build_layout(-2 * DEG, 2 * DEG, 10 * DEG, 0.5 * DEG, 64)
    _, ranges, extents = draw(scene, layout, PLAIN, X_WS)
    column = layout.columns // 2
    used = (layout.solid_angle[column] > 0) & (ranges[column] > 0) & (ranges[column] < 28)
    r, g = ranges[column][used], extents[column][used]
    # Footprints of neighbours have to touch: together they span what lies between the first and the last centre.
    assert g.sum() - (g[0] + g[-1]) / 2 == pytest.approx(abs(r[-1] - r[0]), rel=0.02)


def test_both_windings_answer_alike(draw: Draw) -> None:
    front, back = (draw(world(plate(6.0, 3.0, 1.5, flipped=flipped))) for flipped in (False, True))
    assert front[1].any()
    # The rasteriser starts from another corner: two units in the last place of a range, one of an extent's root.
    np.testing.assert_allclose(front[1], back[1], rtol=3e-7)
    np.testing.assert_allclose(front[0], back[0], atol=4e-5)
    np.testing.assert_allclose(*(np.sqrt(x[2] / np.maximum(x[1], 1) / 1.9) for x in (front, back)), atol=2 / 32767)


@pytest.mark.parametrize("bad", [0.0, np.nan])
def test_without_a_normal_the_triangles_own_plane_answers(draw: Draw, bad: float) -> None:
    tilted = tilted_wall(8.0, 35 * DEG)
    broken = Mesh(tilted.vertices.copy(), np.full((4, 3), bad, np.float32), tilted.faces.copy())
    strength, ranges, _ = draw(world(broken))
    whole, same, _ = draw(world(tilted))
    np.testing.assert_array_equal(ranges, same)
    inside = (FAN.solid_angle > 0) & (ranges > 0) & (ranges < 30)
    # From differences of float32 positions at 30 m over a cell of 0.3 m.
    np.testing.assert_allclose(strength[inside], whole[inside], atol=1e-3)


def test_the_sigmoid_is_the_papers(draw: Draw) -> None:
    strength, _, _ = draw(world(tilted_wall(8.0, 35 * DEG)))
    through, _, _ = draw(world(tilted_wall(8.0, 35 * DEG)), optics=Optics(30.0, 0.1, sigmoid=(18.0, 2 / 3)))
    seen = (FAN.solid_angle > 0) & (strength > 0)
    np.testing.assert_allclose(through[seen], 1 / (1 + np.exp(-18 * (strength[seen] - 2 / 3))), atol=2e-4)  # slope 4.5


def test_attenuation_takes_its_share_there_and_back(draw: Draw) -> None:
    plain, ranges, _ = draw(world(wall(8.0)))
    lossy, _, _ = draw(world(wall(8.0)), optics=Optics(30.0, 0.1, attenuation=0.03))
    seen = (FAN.solid_angle > 0) & (ranges > 0)
    np.testing.assert_allclose(lossy[seen], plain[seen] * np.exp(-0.06 * ranges[seen]), atol=4e-5)  # 16 bits of a root


@pytest.mark.parametrize("reflectance", [1e-3, 0.4, 3.0, 50.0])
def test_reflectance_scales_the_strength(draw: Draw, reflectance: float) -> None:
    plain, ranges, _ = draw(world(tilted_wall(8.0, 35 * DEG)))
    scaled, _, _ = draw(world(tilted_wall(8.0, 35 * DEG), material=Material("loud", reflectance)))
    seen = (FAN.solid_angle > 0) & (ranges > 0)
    step = 2 * np.sqrt(max(1.0, reflectance) * plain[seen] * reflectance) / 65535  # of a root of 16 bits
    assert (np.abs(scaled[seen] - reflectance * plain[seen]) <= 1.1 * step + 3e-5 * reflectance).all()


def test_truth_names_the_body_of_each_sample(renderer: FootprintRenderer) -> None:
    scene = world((sphere(1.0, 0.1), (8, 1.5, 0)), (box((1, 1, 1)), (6, -1.5, 0)), wall(12.0))
    renderer.geometry.update(scene)
    renderer.draw(AT_ORIGIN, FAN, Optics(30.0, 0.1, truth=True))
    bodies = renderer.read()[:, :, 2]
    _, which = first_hits(triangles(scene), directions(FAN))
    counts = [len(part.mesh.faces) for body in scene.bodies.values() for part in body.parts]
    truth = np.searchsorted(np.cumsum(counts), which, side="right") + 1
    used = FAN.solid_angle > 0
    assert (bodies != truth)[used].mean() < 1 / 256  # cells on an edge, as above
    assert set(np.unique(bodies[used])) == {1, 2, 3}


def test_far_from_the_origin_every_bit_is_the_same(draw: Draw) -> None:
    far = np.array([5e5, 4.65e6, 0.0])
    X_WS, X_far = standing(), standing()
    X_far[:3, 3] += far
    here = draw(world(*STANDARD), X_WS=X_WS)
    there = draw(world(*((mesh, position + far) for mesh, position in STANDARD)), X_WS=X_far)
    for one, other in zip(here, there, strict=True):
        assert one.tobytes() == other.tobytes()


def test_an_offset_inside_a_body_cancels_bit_by_bit_too(draw: Draw) -> None:
    """Readers keep a mesh near its own origin and put the whole metres of UTM coordinates into the part's pose."""
    far, turned = np.array([5e5, 4.65e6, 12.0]), standing(-10 * DEG, 0.0)
    X_BM, X_far = np.eye(4), turned.copy()
    X_BM[:3, 3] = far
    X_far[:3, 3] += far
    here = World([Body("ball", [Part(sphere(1.0), Material("plain"), np.eye(4))], standing(0, 1.6))])
    here.bodies["ball"].X_WB[0, 3] = 9.0
    there = World([Body("ball", [Part(sphere(1.0), Material("plain"), X_BM)], here.bodies["ball"].X_WB)])
    made = draw(here, X_WS=turned), draw(there, X_WS=X_far)
    assert made[0][1].any()
    for one, other in zip(*made, strict=True):
        assert one.tobytes() == other.tobytes()


@pytest.mark.parametrize("bins", [1, 2, 5, 500, 4096])
@pytest.mark.parametrize("aperture", [0.1, 20, 120])
def test_the_nearest_that_is_drawn_is_within_the_first_bin_and_a_thousandth_of_the_range(
    bins: int, aperture: float
) -> None:
    layout = build_layout(-60 * DEG, 60 * DEG, aperture / 2 * DEG, 1 * DEG, 24, 0.5)
    near = near_plane(Optics(30.0, 30.0 / bins))
    corner = near / np.cos(layout.views[0].half_width) / np.cos(aperture / 2 * DEG)
    assert corner <= min(30.0 / bins, 30.0 / 900)


def relief(x: float, y: float, z: float) -> Material:
    """A normal map of one tilt everywhere."""
    image = np.broadcast_to(np.rint(np.array([x, y, z]) * 127.5 + 127.5).astype(np.uint8), (8, 8, 3))
    return Material("relief", normal_map=image.copy())


# Texture coordinates of plate(), whose first corner is the lower right one, then lower left: u to the right, v up.
UPRIGHT = [[1, 0], [0, 0], [0, 1], [1, 1]]
MIRRORED = [[0, 0], [1, 0], [1, 1], [0, 1]]  # u to the left
TURNED = [[0, 0], [0, 1], [1, 1], [1, 0]]  # by 90 deg: u up, v to the left


@pytest.mark.parametrize("flipped", [False, True], ids=["front", "back"])
@pytest.mark.parametrize(
    ("uv", "u", "v"),
    [(UPRIGHT, (0, -1, 0), (0, 0, 1)), (MIRRORED, (0, 1, 0), (0, 0, 1)), (TURNED, (0, 0, 1), (0, 1, 0))],
    ids=["upright", "mirrored", "turned"],
)
@pytest.mark.parametrize("tilt", [(0.5, 0.0), (0.0, 0.5), (-0.3, 0.4)])
def test_a_normal_map_tilts_along_its_texture_coordinates(
    draw: Draw, uv: Any, u: Any, v: Any, tilt: tuple[float, float], flipped: bool
) -> None:
    z = np.sqrt(1 - tilt[0] ** 2 - tilt[1] ** 2)
    strength, ranges, _ = draw(world(plate(8.0, 30.0, 30.0, uv=uv, flipped=flipped), material=relief(*tilt, z)))
    normal = tilt[0] * np.array(u) + tilt[1] * np.array(v) + z * np.array([-1, 0, 0])
    seen = (ranges > 0) & (FAN.solid_angle > 0)
    # 8 bits of each component: half of 1/127 in both directions.
    np.testing.assert_allclose(strength[seen], np.abs(directions(FAN) @ normal)[seen], atol=0.008)


def test_a_bump_is_not_a_dent(draw: Draw) -> None:
    """The picture of a hemisphere: its upper half faces up, so a sonar above hears it louder than its lower half."""
    y, x = np.mgrid[1:-1:128j, -1:1:128j]  # first row on top
    inside = x * x + y * y < 0.9
    z = np.sqrt(np.clip(1 - x * x - y * y, 0, 1))
    normals = np.where(inside[..., None], np.stack([x, y, z], axis=-1), [0.0, 0.0, 1.0])
    bump = Material("bump", normal_map=np.rint(normals * 127.5 + 127.5).astype(np.uint8))
    above = standing(25 * DEG, 2.4)
    strength, ranges, _ = draw(world(plate(6.0, 1.5, 1.5, uv=UPRIGHT), material=bump), X_WS=above)
    hit = np.argwhere((ranges > 0) & (FAN.solid_angle > 0))
    middle = hit.mean(axis=0)
    upper, lower = (strength[tuple(hit[keep].T)].mean() for keep in (hit[:, 1] > middle[1], hit[:, 1] < middle[1]))
    assert upper > 1.15 * lower


def test_coordinates_that_do_not_span_the_surface_leave_its_normal_alone(draw: Draw) -> None:
    flat = draw(world(plate(8.0, 30.0, 30.0)))
    pinched = draw(world(plate(8.0, 30.0, 30.0, uv=np.zeros((4, 2))), material=relief(0.5, 0, 0.87)))
    np.testing.assert_allclose(pinched[0], flat[0], atol=1e-6)


def test_a_mesh_without_texture_coordinates_has_its_relief_all_the_same(draw: Draw) -> None:
    """The world lays the picture on it from six sides: the tilt changes, the way it leans does not."""
    flat = draw(world(plate(8.0, 30.0, 30.0)))
    made = draw(world(plate(8.0, 30.0, 30.0), material=relief(0.5, 0, 0.87)))
    inside = (FAN.solid_angle > 0) & (flat[1] > 0)
    assert np.abs(made[0] - flat[0])[inside].mean() > 0.1


@pytest.mark.parametrize(
    "feature", ["WIDE_FAN", "SIGMOID", "ATTENUATION", "TEXTURED", "NORMAL_MAP", "REFLECTANCE_MAP", "TRUTH"]
)
def test_code_of_a_feature_not_in_use_is_not_in_the_source(feature: str) -> None:
    words = {
        "WIDE_FAN": ["ClipDistance", "band", "column_count"],
        "SIGMOID": ["sigmoid"],
        "ATTENUATION": ["attenuation"],
        "TEXTURED": [r"in vec2 uv", "in_uv"],
        "NORMAL_MAP": ["normal_map", "normal_layer"],
        "REFLECTANCE_MAP": ["reflectance_map", "reflectance_layer"],
        "TRUTH": ["body_id", "in_id", "uvec4"],
    }
    every = dict.fromkeys(words, 1)
    for name in ("footprint.vert", "footprint.frag"):
        without = load_source("sonar_component.render.shaders", name, {k: 1 for k in every if k != feature})
        code = [line.partition("//")[0] for line in without.split("\n")]
        assert not [line for line in code for word in words[feature] if re.search(word, line)]


def test_what_is_not_in_use_has_no_texture_and_no_buffer(renderer: FootprintRenderer) -> None:
    assert renderer.features(PLAIN) == {}
    renderer.geometry.update(World())
    assert renderer.geometry.loaded is None
    renderer.geometry.update(world(sphere(1.0)))
    assert renderer.geometry.loaded.normal_maps is renderer.geometry.loaded.reflectance_maps is None
    assert renderer.geometry.loaded.vertices.size == 24 * len(sphere(1.0).vertices)  # position and normal only
    renderer.geometry.update(world(sphere(1.0), material=relief(0, 0, 1)))
    assert renderer.features(PLAIN) == {"TEXTURED": 1, "NORMAL_MAP": 1}
    renderer.geometry.update(world(sphere(1.0)))
    assert renderer.geometry.loaded.normal_maps is None


def test_an_empty_world_and_one_out_of_sight_draw_nothing(draw: Draw) -> None:
    for scene in (World(), World([Body("frame", [], np.eye(4))]), world((sphere(1.0), (-9, 0, 0)))):
        strength, ranges, _ = draw(scene)
        assert not strength.any()
        assert not ranges.any()


def test_triangles_without_area_and_vertices_that_are_not_numbers_harm_nobody_else(draw: Draw) -> None:
    sound = plate(6.0, 3.0, 1.5)
    extra = np.array([[5, 0, 0], [5, 1, 0], [5, 0, 0], [np.nan, 0, 0], [4, 1, 1], [4, 0, np.inf]])
    vertices = np.concatenate([sound.vertices, extra])
    normals = np.concatenate([sound.normals, np.zeros((6, 3), np.float32)])
    faces = np.concatenate([sound.faces, np.array([[4, 5, 6], [4, 4, 5], [7, 8, 9], [8, 9, 4]], np.int32)])
    made = draw(world(Mesh(vertices, normals, faces)))
    for one, other in zip(made, draw(world(sound)), strict=True):
        np.testing.assert_array_equal(one, other)


def test_two_surfaces_that_cross_are_told_apart_by_depth(draw: Draw) -> None:
    crossing = [rectangle([[4, -3, -3], [12, 3, -3], [12, 3, 3], [4, -3, 3]]), plate(8.0, 12.0, 6.0)]
    _, ranges, _ = draw(world(*crossing))
    truth, _ = first_hits(triangles(world(*crossing)), directions(FAN))
    used = (FAN.solid_angle > 0) & np.isfinite(truth)
    assert (np.abs(ranges - truth)[used] > 1e-3).mean() < 1 / 256


def test_the_camera_draws_the_same_picture_before_and_after_a_ping(context: Any, draw: Draw) -> None:
    from sonar_component.render.camera import Camera, View, Water

    camera = Camera(context, View(width=64, height=48), Water())
    scene = world(*STANDARD)
    before = camera.draw_linear(scene, standing()).copy()
    draw(scene, X_WS=standing())
    np.testing.assert_array_equal(camera.draw_linear(scene, standing()), before)
    camera.release()
