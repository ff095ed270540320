"""Pings of surfaces whose echo can be written down: ranges, bearings and energies."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sonar_component.samples import Sonar
from sonar_component.scene import Material
from sonar_component.scene.shapes import sphere
from sonar_component.sonars.settings import ForwardLookingSettings
from tests.reference import closed_forms
from tests.reference.poses import pose
from tests.reference.scenes import STANDARD, floor, plate, shell, tilted_wall, wall, world

DEG = np.pi / 180
RANGE = 10.0  # [m]
SMALL: dict[str, Any] = {"beam_count": 32, "beam_width": 40 * DEG, "range": RANGE, "normalization": "energy"}
TABLES = {
    "equal_angle": {"bearings": "equal_angle", "beam_count": 192, "beam_width": 130 * DEG},
    "equal_sine": {"bearings": "equal_sine", "beam_count": 192, "beam_width": 130 * DEG},
    # A table of no rule: steps from a third to two thirds of a degree.
    "list": {"bearings": (np.cumsum(0.5 + np.sin(np.arange(260)) / 6) - 65).astype(float)},
}
TABLES["list"]["bearings"] = (TABLES["list"]["bearings"] * DEG).tolist()


def beam_energy(sample: Sonar, settings: dict[str, Any]) -> np.ndarray:
    """(beams,) energy in each beam [sr]."""
    return sample.bins.sum(axis=1, dtype=np.float64) * ForwardLookingSettings(**settings).beam_table().solid_angle


# Range -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("normalization", ["mean", "energy"])
def test_plane_ladder(ping: Any, record_testsuite_property: Any, normalization: str) -> None:
    """Planes at 2, 4, 6, 8 m, tilted by 0, 15, 30, 45 deg, with bin counts that no buffer is padded to.

    The range heard is the centroid of a beam's echo, the truth the plane's range on the beam's axis. Quantisation alone
    is 1 / sqrt(12) = 0.289 bin where the echo fills one bin, and less where it fills several.
    """
    errors, early = [], []
    for bins in (301, 399, 511, 513):
        settings = dict(SMALL, beam_count=31, beam_width=10 * DEG, beam_height=1 * DEG, bin_count=bins)
        settings["normalization"] = normalization
        table = ForwardLookingSettings(**settings).beam_table()
        for distance in (2.0, 4.0, 6.0, 8.0):
            for tilt in (0, 15, 30, 45):
                sample = ping(world(tilted_wall(distance, tilt * DEG)), **settings)
                centroid = (sample.bins * np.arange(0.5, bins)).sum(axis=1) / sample.bins.sum(axis=1)
                axis = closed_forms.nearest_of_tilted_wall(distance, tilt * DEG, table.bearings, table.bearings)
                nearest = closed_forms.nearest_of_tilted_wall(distance, tilt * DEG, table.right, table.left)
                errors.append(centroid - axis * bins / RANGE)
                early.append(np.floor(nearest * bins / RANGE) - (sample.bins > 0).argmax(axis=1))
    rmse = float(np.sqrt(np.mean(np.square(errors))))
    record_testsuite_property(f"plane ladder, {normalization}, range RMSE [bins]", rmse)
    assert rmse <= 0.30
    assert np.abs(errors).max() <= 0.6  # half a bin, and a tenth for the plane's curvature over the beam
    assert np.abs(early).max() <= 1  # the first lit bin is that of the nearest point, or beside its edge


def test_no_energy_comes_before_the_true_first_range(ping: Any) -> None:
    settings = dict(SMALL, bin_count=513, beam_height=20 * DEG)
    table = ForwardLookingSettings(**settings).beam_table()
    for scene, nearest in (
        (world(wall(4.0)), 4.0 / np.cos(np.abs(table.bearings).clip(table.width / 64) - table.width / 64)),
        (world((sphere(1.0), (5.0, 0, 0))), np.full(32, 4.0)),
        (world(floor(1.0)), np.full(32, 1.0 / np.sin(10 * DEG))),
    ):
        for normalization in ("energy", "mean"):
            bins = ping(scene, **dict(settings, normalization=normalization)).bins
            # Half of a footprint may reach into the bin before: the surface's own curve over one cell.
            before = np.arange(513)[None, :] < np.floor(nearest * 513 / RANGE)[:, None] - 1
            assert bins.any()
            assert not bins[before].any()


@pytest.mark.parametrize(("range_", "bins"), [(0.5, 500), (0.5, 1), (500.0, 1500), (500.0, 2), (50.0, 511)])
def test_the_shortest_and_the_longest_range_stand_in_the_right_bin(ping: Any, range_: float, bins: int) -> None:
    for part in (0.3, 0.77):
        made = ping(world(wall(part * range_)), **dict(SMALL, beam_width=0.5 * DEG, beam_count=2, beam_height=0.5 * DEG,
                    range=range_, bin_count=bins))  # fmt: skip
        assert (made.bins.argmax(axis=1) == int(part * bins)).all()
        # Of a wall seen within 0.5 deg all energy comes back.
        assert made.bins.sum(axis=1) == pytest.approx(1.0, rel=1e-3)
        assert made.bin_length == pytest.approx(range_ / bins)


@pytest.mark.parametrize("bins", [1, 2, 511, 513, 1500])
def test_bins_add_up_to_the_same_energy_however_many_they_are(ping: Any, bins: int) -> None:
    settings = dict(SMALL, bin_count=bins)
    table = ForwardLookingSettings(**settings).beam_table()
    sample = ping(world(wall(3.0)), **settings)
    truth = closed_forms.wall_energy(table.bearings, table.right, table.left, table.half_height)
    # 16 bits of the strength's root make 1.5e-5 of a cosine; a beam shares its columns with its neighbours to float32.
    np.testing.assert_allclose(sample.bins.sum(axis=1), truth, rtol=5e-4)


# Bearing ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("table", TABLES.values(), ids=TABLES.keys())
def test_targets_over_130_deg_stand_at_their_bearing(
    ping: Any, table: dict[str, Any], record_testsuite_property: Any
) -> None:
    """Narrow posts on a ring; the energy centroid of the beams that hear one against its bearing."""
    settings = {"range": RANGE, "bin_count": 100, "beam_height": 10 * DEG, "normalization": "energy", "accuracy": 0.005}
    fan = ForwardLookingSettings(**table, **settings).beam_table()
    errors, widths = [], []
    for first in (-62.3, -61.1):
        posts = np.arange(first, 64, 8.91) * DEG
        # Balls a third wider than a beam.
        balls = [(sphere(0.08), (8 * np.cos(a), 8 * np.sin(a), 0)) for a in posts]
        sample = ping(world(*balls), **table, **settings)
        # Where a beam hears part of a post, its energy lies at that part and not at the beam's centre: compare with
        # what a beam table makes of a disc, beam by beam.
        energy = sample.bins.sum(axis=1) * fan.solid_angle
        for angle in posts:
            near = np.abs(fan.bearings - angle) < 3 * DEG
            heard = float((energy * fan.bearings)[near].sum() / energy[near].sum())
            fine = np.linspace(-1, 1, 4001)
            offset = np.arcsin(0.08 / 8) * fine
            weight = 1 - fine**2  # cosine over each vertical chord of a ball: pi / 2 (1 - x^2)
            beam = (
                np.clip(np.searchsorted(-fan.left, -(angle + offset), side="right") - 1, 0, len(fan.left) - 1)
                if fan.left[0] > fan.left[-1]
                else np.searchsorted(fan.left, angle + offset)
            )
            truth = float((weight * fan.bearings[beam]).sum() / weight.sum())
            errors.append(heard - truth)
            widths.append(float((fan.left - fan.right)[near].mean()))
    worst, in_beams = np.degrees(np.abs(errors)).max(), np.abs(np.array(errors) / widths).max()
    record_testsuite_property("bearing error [deg]", worst)
    record_testsuite_property("bearing error [beams]", in_beams)
    assert worst <= 0.02
    assert in_beams <= 0.05


def test_left_is_positive_and_up_is_up(ping: Any) -> None:
    scene = world((sphere(0.3), (5.0, 1.5, 0.6)), (sphere(0.5), (7.0, -1.0, 0)))
    sample = ping(scene, **dict(SMALL, bin_count=500, beam_height=20 * DEG))
    left, right = sample.bearings > 0, sample.bearings < 0
    near, far = slice(230, 300), slice(310, 400)
    assert sample.bins[left, near].any()
    assert not sample.bins[right, near].any()
    assert sample.bins[right, far].any()
    assert not sample.bins[left, far].any()
    # The left one stands 6.5 deg above the axis: turned up by 17 deg, only it stays within the 20 deg of the aperture.
    up = ping(scene, pose(rpy_deg=(0, -17, 0)), **dict(SMALL, bin_count=500, beam_height=20 * DEG))
    assert up.bins[left, near].any()
    assert not up.bins[right].any()
    # Rolled to the right by 90 deg, the sonar's left is up: what stood to its left now lies below, out of its aperture.
    rolled = ping(world((sphere(0.3), (5.0, 0, 2.5))), pose(rpy_deg=(90, 0, 0)), **dict(SMALL, beam_width=60 * DEG))
    bearing = rolled.bearings[rolled.bins.sum(axis=1).argmax()]
    assert bearing == pytest.approx(np.arctan2(2.5, 5.0), abs=2 * DEG)


def test_a_mirrored_scene_gives_the_mirrored_image(ping: Any) -> None:
    settings = dict(SMALL, bin_count=200, beam_count=64, beam_width=60 * DEG, accuracy=0.005)
    objects = [((5.0, 1.2, 0.2), 0.5), ((7.0, -2.0, -0.3), 0.8)]
    one, other = (
        ping(world(wall(9.0), *((sphere(r), (x, s * y, z)) for (x, y, z), r in objects)), **settings).bins
        for s in (1, -1)
    )
    # Columns are sheared one way, so edges are sampled elsewhere: twice the accuracy that was asked for.
    assert np.linalg.norm(one - other[::-1]) <= 2 * 0.005 * np.linalg.norm(one)
    assert np.linalg.norm(one - other) > 0.3 * np.linalg.norm(one)


@pytest.mark.parametrize("width", [359.0, 360.0])
def test_a_full_turn_sees_all_around(ping: Any, width: float) -> None:
    settings = dict(SMALL, beam_count=360, beam_width=width * DEG, bin_count=50, beam_height=10 * DEG)
    # The fan of 359 deg leaves out one degree behind it: nothing is put there.
    for angle in np.array([0, 60, 135, -90, -171, *([178, 180, -178] if width == 360 else [])]) * DEG:
        sample = ping(world((sphere(0.6), (6 * np.cos(angle), 6 * np.sin(angle), 0))), **settings)
        energy = sample.bins.sum(axis=1)
        # About the target, so that what lies beyond +-180 deg counts on its own side.
        offset = np.angle(np.exp(1j * (sample.bearings - angle)))
        assert (energy * offset).sum() / energy.sum() == pytest.approx(0, abs=0.05 * DEG)
        assert np.abs(offset[energy > 0]).max() < np.arcsin(0.1) + 1 * DEG


# Energy ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("table", TABLES.values(), ids=TABLES.keys())
def test_a_shell_of_one_range_is_flat_over_azimuth(
    ping: Any, table: dict[str, Any], record_testsuite_property: Any
) -> None:
    settings = {**table, "range": RANGE, "bin_count": 500, "beam_height": 20 * DEG}
    scene = world(shell(6.01, 75 * DEG, 12 * DEG))
    energy = ping(scene, normalization="energy", **settings).bins
    record_testsuite_property("shell, flatness over azimuth", float(np.abs(energy.sum(axis=1) - 1).max()))
    assert np.abs(energy.sum(axis=1) - 1).max() <= 0.01
    mean = ping(scene, **settings).bins
    assert np.flatnonzero(mean.any(axis=0)).tolist() == [300]
    # Facets of 0.5 deg shade to 1 - 1e-5; 16 bits of a root are 3e-5.
    np.testing.assert_allclose(mean[:, 300], closed_forms.sigmoid(1.0), atol=1e-4)


@pytest.mark.parametrize(("height", "beam_height"), [(0.5, 20.0), (1.0, 20.0), (2.0, 20.0), (0.5, 60.0), (2.0, 60.0)])
def test_a_flat_bottom_falls_with_the_cube_of_range_to_the_end(
    ping: Any, height: float, beam_height: float, record_testsuite_property: Any
) -> None:
    settings: dict[str, Any] = {"range": 20.0, "bin_count": 400, "beam_count": 64, "beam_width": 120 * DEG}
    settings |= {"beam_height": beam_height * DEG, "normalization": "energy"}
    sample = ping(world(floor(height)), **settings)
    truth = closed_forms.flat_bottom(height, beam_height / 2 * DEG, np.linspace(0, 20.0, 401))
    first = int(height / np.sin(beam_height / 2 * DEG) / 0.05)
    made = sample.bins.astype(np.float64)
    assert not made[:, : first - 1].any()  # and nothing before, but for half a footprint
    assert (made[:, first + 1 :] > 0).all()  # no holes to the end of the range
    off = np.abs(made[:, first + 2 :].mean(axis=0) / truth[first + 2 :] - 1).max()
    record_testsuite_property(f"flat bottom {height} m below, {beam_height} deg high: worst bin of the fan", off)
    assert off <= 0.02
    # Each beam for itself, over tenths of the range: bins carry the ends of the few footprints that cover them.
    blocks = np.array_split(np.arange(first + 2, 400), 10)
    ratio = np.array([made[:, block].sum(axis=1) / truth[block].sum() for block in blocks])
    assert np.abs(ratio - 1).max() <= 0.01
    assert made.sum() / 64 == pytest.approx(truth.sum(), rel=0.005)


def test_the_first_bottom_return_comes_from_the_edge_of_the_aperture(ping: Any) -> None:
    for beam_height in (10.0, 20.0, 40.0, 90.0, 120.0):
        sample = ping(world(floor(0.5)), **dict(SMALL, beam_height=beam_height * DEG, bin_count=1000))
        first = (sample.bins > 0).argmax(axis=1) * 0.01
        # One bin of 10 mm, and at the corner of a cell half of its own bend.
        assert first == pytest.approx(0.5 / np.sin(beam_height / 2 * DEG), abs=0.02)


def test_a_ball_returns_its_closed_form(ping: Any) -> None:
    settings = dict(SMALL, beam_count=1, beam_width=40 * DEG, beam_height=40 * DEG, bin_count=400, accuracy=0.005)
    sample = ping(world((sphere(0.5, 1e-4), (5.0, 0, 0))), **settings)
    truth = closed_forms.sphere_profile(0.5, 5.0, np.linspace(0, RANGE, 401))
    made = beam_energy(sample, settings)[0]
    assert made == pytest.approx(truth.sum(), rel=0.01)  # twice the accuracy that was asked for
    profile = sample.bins[0] * ForwardLookingSettings(**settings).beam_table().solid_angle[0]
    assert np.linalg.norm(profile - truth) <= 0.03 * np.linalg.norm(truth)


def test_the_echo_of_a_plate_is_proportional_to_its_height(ping: Any, record_testsuite_property: Any) -> None:
    """At the default accuracy, 5 m away, as measured on peers: from 0.05 m to 0.5 m."""
    settings = {"range": 10.0, "bin_count": 500, "normalization": "energy", "beam_height": 20 * DEG}
    ratios = []
    for height in (0.05, 0.1, 0.2, 0.3, 0.5):
        energy = beam_energy(ping(world(plate(5.0, 0.5, height)), **settings), settings).sum()
        ratios.append(energy / closed_forms.plate_energy(5.0, 0.5, height))
    record_testsuite_property("plate 0.05 to 0.5 m, energy over closed form", [round(float(r), 4) for r in ratios])
    assert np.abs(np.array(ratios) - 1).max() <= 0.02


def test_reflectance_scales_the_energy_whatever_the_view(ping: Any) -> None:
    settings = dict(SMALL, bin_count=100, gain=0.05)  # gain below unity, or full scale would clip the loud one
    for yaw in (0, 25, -10):
        at = pose(rpy_deg=(0, 5, yaw))
        turned = [
            ping(world((sphere(1.0), (5, 1, 0)), wall(8.0), material=Material("m", r)), at, **settings).bins.sum()
            for r in (1.0, 0.3, 2.5)
        ]
        # Strengths below 1 are kept to 16 bits of their root: 1e-4 at 0.1.
        assert turned[1] / turned[0] == pytest.approx(0.3, rel=1e-3)
        assert turned[2] / turned[0] == pytest.approx(2.5, rel=1e-3)


# Invariance ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("normalization", ["mean", "energy"])
def test_the_scene_and_the_sonar_moved_give_the_same_bits(ping: Any, normalization: str) -> None:
    settings: dict[str, Any] = {"range": 30.0, "bin_count": 500, "beam_count": 64, "normalization": normalization}
    offset = np.array([5e5, 4.65e6, -40.0])
    here = ping(world(*STANDARD), pose((0, 0, 3), (0, 15, 0)), **settings)
    moved = world(*((mesh, position + offset) for mesh, position in STANDARD))
    there = ping(moved, pose(offset + np.array([0, 0, 3]), (0, 15, 0)), **settings)
    assert here.bins.any()
    assert here.bins.tobytes() == there.bins.tobytes()


def test_ten_thousand_kilometres_away_the_same_bits_too(ping: Any) -> None:
    offset = np.array([1e7, -1e7, 0.0])
    here = ping(world(wall(4.0), (sphere(0.5), (3, 0.7, 0))), **dict(SMALL, bin_count=200))
    moved = world((wall(4.0), offset), (sphere(0.5), offset + np.array([3, 0.7, 0])))
    assert here.bins.tobytes() == ping(moved, pose(offset), **dict(SMALL, bin_count=200)).bins.tobytes()


def test_the_same_inputs_give_the_same_bits(ping: Any) -> None:
    settings: dict[str, Any] = {"range": 30.0, "bin_count": 500, "beam_count": 64}
    one, other = (ping(world(*STANDARD), pose((0, 0, 3), (0, 15, 0)), **settings).bins for _ in range(2))
    assert one.tobytes() == other.tobytes()


def test_q_and_minus_q_are_one_orientation(ping: Any) -> None:
    at = pose((0, 0, 3), (3, 15, 20))
    other = pose((0, 0, 3))
    other.orientation = -at.orientation
    settings: dict[str, Any] = {"range": 30.0, "bin_count": 200, "beam_count": 32}
    assert (
        ping(world(*STANDARD), at, **settings).bins.tobytes()
        == ping(world(*STANDARD), other, **settings).bins.tobytes()
    )


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("orientation", [1.0, 0.1, 0.0, 0.0], "unit quaternion, got length 1.00499"),
        ("orientation", [0.0, 0.0, 0.0, 0.0], "unit quaternion, got length 0"),
        ("orientation", [np.nan, 0.0, 0.0, 0.0], "4 finite numbers"),
        ("position", [0.0, np.inf, 0.0], "3 finite numbers"),
    ],
)
def test_a_pose_that_is_none_is_refused_with_the_reason(ping: Any, field: str, value: Any, message: str) -> None:
    at = pose()
    setattr(at, field, np.array(value))
    with pytest.raises(ValueError, match=message):
        ping(world(wall(4.0)), at, **SMALL)


def test_both_windings_give_the_same_image(ping: Any) -> None:
    settings = dict(SMALL, bin_count=100)
    front, back = (ping(world(plate(5.0, 2.0, 1.0, flipped=f)), **settings).bins for f in (False, True))
    # The rasteriser starts from another corner, which moves float32 in its last place.
    np.testing.assert_allclose(front, back, atol=2e-5)
    assert front.any()


def test_the_graphics_card_and_the_cpu_give_the_same_image(ping: Any) -> None:
    for normalization in ("mean", "energy"):
        settings: dict[str, Any] = {"range": 30.0, "bin_count": 500, "beam_count": 64, "normalization": normalization}
        cpu, gpu = (
            ping(world(*STANDARD), pose((0, 0, 3), (0, 15, 0)), reduction=where, **settings).bins
            for where in ("cpu", "gpu")
        )
        # float32 sums against integers of 2^-31 of a beam; a bin beside the threshold of empty may be lit in one only.
        assert ((cpu > 0) != (gpu > 0)).mean() < 0.02
        both = (cpu > 0) & (gpu > 0)
        np.testing.assert_allclose(cpu[both], gpu[both], atol=2e-3)
        assert np.linalg.norm((cpu - gpu)[both]) <= 1e-4 * np.linalg.norm(cpu)
