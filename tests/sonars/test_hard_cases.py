"""What simulators got wrong before: near and far corners, odd sizes, broken geometry, the sonar inside a thing."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from sonar_component.scene import Body, Material, Mesh, World
from sonar_component.scene.shapes import box, sphere
from sonar_component.sonars import imager, plan
from sonar_component.sonars.settings import ForwardLookingSettings
from tests.reference.poses import pose
from tests.reference.scenes import STANDARD, floor, plate, rectangle, shell, wall, world

DEG = np.pi / 180
SMALL: dict[str, Any] = {"beam_count": 32, "beam_width": 40 * DEG, "range": 10.0, "bin_count": 200}


def corner_direction(azimuth: float, elevation: float) -> np.ndarray:
    return np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])


def ball_at(direction: np.ndarray, distance: float, radius: float) -> World:
    return world((sphere(radius, radius / 50), direction * distance))


@pytest.mark.parametrize(("width", "height"), [(120, 20), (360, 120), (40, 120), (1, 1), (130, 0.1)])
@pytest.mark.parametrize("min_range", [0.0, 0.5])
def test_a_target_one_bin_behind_min_range_is_heard_in_every_corner_also_after_reconfiguring(
    make: Any, width: float, height: float, min_range: float
) -> None:
    """A near plane that is flat, or forgotten when the range changes, cuts the corners off."""
    first = {"beam_count": 16, "beam_width": width * DEG, "beam_height": height * DEG, "min_range": min_range}
    settings = [
        ForwardLookingSettings(range=10.0, bin_count=100, **first),
        ForwardLookingSettings(range=40.0, bin_count=500, **first),
        ForwardLookingSettings(range=10.0, bin_count=100, **first),
    ]
    sonar = make(settings[0])
    for each in settings:
        sonar.settings = each
        dr = each.range / each.bin_count
        for side, up in itertools.product((-1, 1), (-1, 1)):
            # Just inside the corner, and large enough to be seen: a fifth of a beam, a fifth of the aperture.
            inside = 0.5 * width / 16 * DEG, 0.1 * height * DEG
            direction = corner_direction(side * (width / 2 * DEG - inside[0]), up * (height / 2 * DEG - inside[1]))
            radius = 0.2 * dr
            bins = sonar.ping(ball_at(direction, min_range + 1.5 * dr + radius, radius), pose()).bins
            assert bins[:, round(min_range / dr) + 1].any(), (side, up, each.range)


def facing_plate(direction: np.ndarray, distance: float, size: float) -> World:
    side = np.cross([0, 0, 1], direction)
    side /= np.linalg.norm(side)
    up, centre = np.cross(direction, side), direction * distance
    corners = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    return world(rectangle([centre + size / 2 * (a * side + b * up) for a, b in corners]))


@pytest.mark.parametrize(("width", "height"), [(120, 20), (40, 120), (360, 40)])
def test_a_target_beyond_the_range_gives_exactly_nothing_in_the_corners(ping: Any, width: float, height: float) -> None:
    """A flat far plane lets r exceed its distance at the sides, and an unchecked bin index writes where it must not."""
    settings = dict(SMALL, beam_width=width * DEG, beam_height=height * DEG)
    for side, up in ((0, 0), *itertools.product((-1, 1), (-1, 1))):
        direction = corner_direction(side * width / 2.1 * DEG, up * height / 2.1 * DEG)
        assert ping(facing_plate(direction, 9.9, 0.5), **settings).bins.any()
        for beyond in (10.1, 12.0, 30.0):
            assert not ping(facing_plate(direction, beyond, 0.5), **settings).bins.any()
        assert not ping(ball_at(direction, 10.3, 0.1), **settings).bins.any()


@pytest.mark.parametrize("beams", [1, 2, 700, 2048])
@pytest.mark.parametrize("bins", [1, 2, 511, 513, 1500])
def test_every_beam_of_any_fan_hears_a_shell(ping: Any, beams: int, bins: int) -> None:
    settings = {"beam_count": beams, "bin_count": bins, "beam_width": 60 * DEG, "beam_height": 5 * DEG, "range": 10.0}
    sample = ping(world(shell(6.0176, 35 * DEG, 4 * DEG, 1 * DEG)), normalization="energy", **settings)
    assert sample.bins.shape == (beams, bins)
    # Facets lean by half a degree: over a cell of 2 deg, in a fan of one beam, that is half of the shortest bins.
    k = int(0.60176 * bins)
    assert (sample.bins.argmax(axis=1) == k).all()
    assert not np.delete(sample.bins, [max(k - 1, 0), k, min(k + 1, bins - 1)], axis=1).any()
    np.testing.assert_allclose(sample.bins.sum(axis=1), 1.0, atol=1e-3)  # facets of 1 deg shade to 1 - 4e-5


def test_2048_beams_at_the_finest_accuracy_fit_the_target(ping: Any) -> None:
    settings = dict(SMALL, beam_count=2048, beam_width=130 * DEG, beam_height=4 * DEG, bin_count=50)
    scene = world((sphere(0.5), (5, 0, 0)), (box((1, 1, 1)), (6, 3, 0)))
    assert ping(scene, accuracy=0.001, **settings).bins.any()


@pytest.mark.parametrize("beam_height", [0.1, 120.0])
def test_the_flattest_and_the_tallest_aperture_keep_their_energy(ping: Any, beam_height: float) -> None:
    settings = dict(SMALL, beam_height=beam_height * DEG, normalization="energy")
    sample = ping(world(shell(6.02, 25 * DEG, min(beam_height, 75) * DEG, 1 * DEG)), **settings)
    np.testing.assert_allclose(sample.bins.sum(axis=1), 1.0, atol=1e-3)


@pytest.mark.parametrize("reduction", ["cpu", "gpu"])
@pytest.mark.parametrize("normalization", ["mean", "energy"])
def test_an_empty_scene_is_exactly_zero(ping: Any, reduction: str, normalization: str) -> None:
    settings = dict(SMALL, reduction=reduction, normalization=normalization)
    for scene in (World(), World([Body("frame", [], np.eye(4))]), world((sphere(1.0), (-5, 0, 0)))):
        assert not ping(scene, **settings).bins.any()


def test_after_a_full_scene_an_empty_one_is_zero_too(make: Any) -> None:
    sonar = make(ForwardLookingSettings(**SMALL))
    assert sonar.ping(world(wall(5.0)), pose()).bins.any()
    assert not sonar.ping(World(), pose()).bins.any()
    assert sonar.ping(world(wall(5.0)), pose()).bins.any()


BROKEN = {
    "a vertex that is not a number": (np.array([[4, 0, 0], [4, 1, np.nan], [4, 1, 1.0]]), [[0, 0, 1]] * 3, [[0, 1, 2]]),
    "an infinite vertex": (np.array([[4, 0, 0], [4, 1, np.inf], [4, 1, 1.0]]), [[0, 0, 1]] * 3, [[0, 1, 2]]),
    "a vertex on the sonar": (np.array([[0, 0, 0], [-1, 1, 0], [-1, -1, 0.0]]), [[0, 0, 1]] * 3, [[0, 1, 2]]),
    "no area": (np.array([[4, 0, 0], [4, 1, 0], [4, 2, 0.0]]), [[1, 0, 0]] * 3, [[0, 1, 2], [0, 0, 1], [2, 2, 2]]),
    "an edge-on triangle": (np.array([[2, 0, 0], [9, 0, 0], [9, 0, 1.0]]), [[0, 1, 0]] * 3, [[0, 1, 2]]),
    "a vertex at 1e30 m": (np.array([[4, 9, 9], [4, 9.1, 9], [1e30, 1e30, 1e30]]), [[0, 0, 1]] * 3, [[0, 1, 2]]),
}


@pytest.mark.parametrize("broken", BROKEN.values(), ids=BROKEN.keys())
@pytest.mark.parametrize("reduction", ["cpu", "gpu"])
def test_broken_triangles_leave_the_image_finite_and_the_other_objects_as_they_were(
    ping: Any, broken: Any, reduction: str
) -> None:
    vertices, normals, faces = broken
    bad = Mesh(vertices.astype(float), np.array(normals, np.float32), np.array(faces, np.int32))
    sound = ping(world((sphere(0.5), (5, -1, 0))), reduction=reduction, **SMALL).bins
    bins = ping(world((sphere(0.5), (5, -1, 0)), bad), reduction=reduction, **SMALL).bins
    assert np.isfinite(bins).all()
    right = slice(16, 32)  # where the ball is and no broken triangle
    changed = np.linalg.norm(bins[right] - sound[right])
    assert changed <= 0.05 * np.linalg.norm(sound)  # a finer or coarser plan may have been chosen for the whole scene


@pytest.mark.parametrize("normal", [[0, 0, 0], [np.nan, 0, 0], [np.inf, 0, 0]])
def test_normals_that_are_none_are_replaced_by_the_triangles_own(ping: Any, normal: Any) -> None:
    whole = plate(5.0, 2.0, 1.0)
    broken = Mesh(whole.vertices.copy(), np.tile(np.array([normal], np.float32), (4, 1)), whole.faces.copy())
    settings = dict(SMALL, normalization="energy")
    bins, truth = ping(world(broken), **settings).bins, ping(world(whole), **settings).bins
    assert np.isfinite(bins).all()
    assert np.linalg.norm(bins - truth) <= 1e-3 * np.linalg.norm(truth)  # a normal from float32 differences


@pytest.mark.parametrize("position", [(0, 0, 0), (0.3, 0, 0), (-0.2, 0.1, 0)])
def test_inside_a_box_every_beam_hears_its_walls(ping: Any, position: Any) -> None:
    settings = dict(SMALL, beam_width=360 * DEG, range=4.0, normalization="energy")
    sample = ping(world((box((2, 2, 2)), position)), **settings)
    assert np.isfinite(sample.bins).all()
    energy = sample.bins.sum(axis=1)
    assert (energy > 0.6).all()  # the least cosine over a face of a cube is 1 / sqrt(3) in its corner
    assert (energy <= 1).all()


def test_a_sonar_on_a_surface_and_a_hull_around_it_leave_the_image_finite(ping: Any) -> None:
    tiny, level = sphere(1e-4), floor(0.0, 20.0)
    for scene in (world(level), world(tiny), world(level, tiny, wall(5.0)), world((sphere(0.01), (0.01, 0, 0)))):
        for reduction in ("cpu", "gpu"):
            assert np.isfinite(ping(scene, reduction=reduction, **SMALL).bins).all()


@pytest.mark.parametrize("reflectance", [1e-30, 1e-6, 1e6])
@pytest.mark.parametrize("reduction", ["cpu", "gpu"])
@pytest.mark.parametrize("normalization", ["mean", "energy"])
def test_the_loudest_and_the_faintest_material_leave_the_image_finite(
    ping: Any, reflectance: float, reduction: str, normalization: str
) -> None:
    settings = dict(SMALL, reduction=reduction, normalization=normalization)
    material = Material("extreme", reflectance)
    bins = ping(world((sphere(0.5), (5, -1, 0)), wall(8.0), material=material), **settings).bins
    assert np.isfinite(bins).all()
    assert bins.max() <= 1


@pytest.mark.parametrize("reflectance", [1.1e6, 3e38, 1e300])
def test_a_reflectance_that_would_overflow_float32_is_refused(reflectance: float) -> None:
    with pytest.raises(ValueError, match=r"reflectance must be greater than 0 and at most 1e\+06, got"):
        Material("loud", reflectance)


def test_q_of_any_length_but_one_is_refused(ping: Any) -> None:
    at = pose()
    at.orientation = at.orientation * 1.001
    with pytest.raises(ValueError, match=r"unit quaternion, got length 1\.001"):
        ping(world(wall(5.0)), at, **SMALL)


def test_noise_amplified_to_full_scale_is_not_what_an_empty_frame_gives(make: Any) -> None:
    settings = ForwardLookingSettings(**SMALL, enable_speckle_noise=True)
    sonar = make(settings)
    bins = sonar.ping(World(), pose(), np.random.default_rng(1)).bins
    assert np.isfinite(bins).all()
    assert bins.max() < 0.2  # speckle multiplies what is there; the paper's floor is 0.03


def test_rows_doubled_change_the_energy_by_less_than_half_a_percent(
    make: Any, monkeypatch: pytest.MonkeyPatch, record_testsuite_property: Any
) -> None:
    """The samples of the default accuracy, then the same columns with twice the rows, on the original's scene."""
    settings = ForwardLookingSettings(range=30.0, bin_count=500, normalization="energy")
    sonar = make(settings)
    at, scene = pose((0, 0, 3), (0, 15, 0)), world(*STANDARD)
    once = sonar.ping(scene, at).bins
    level, plain = sonar._imager._level, plan.plan_at
    monkeypatch.setattr(imager, "plan_at", lambda beams, level: replace(p := plain(beams, level), rows=2 * p.rows))
    monkeypatch.setattr(imager, "choose_level", lambda *_: (level, 0.0))
    doubled = make(settings)
    twice = doubled.ping(scene, at).bins
    rows = [each._imager._table(level).layout.rows for each in (sonar, doubled)]
    assert rows[1] > 1.9 * rows[0]
    change = abs(float(twice.sum(dtype=float) / once.sum(dtype=float)) - 1)
    record_testsuite_property("rows doubled, change of the energy", change)
    assert change < 0.005
