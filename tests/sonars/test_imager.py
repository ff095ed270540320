"""Images of a sonar that runs for long: settings that change, truth beside the image, memory that stays flat."""

from __future__ import annotations

import ctypes
import gc
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from sonar_component.scene import Body, Material, Part, World
from sonar_component.scene.shapes import box, sphere
from sonar_component.sonars.forward_looking import ForwardLookingSonar
from sonar_component.sonars.settings import ForwardLookingSettings
from tests.reference.poses import pose
from tests.reference.scenes import STANDARD, floor, wall, world

DEG = np.pi / 180
SMALL: dict[str, Any] = {"beam_count": 32, "beam_width": 40 * DEG, "range": 10.0, "bin_count": 200}
TWO: list[Any] = [(sphere(0.5), (5, 1, 0)), (box((1, 1, 1)), (7, -1.5, 0))]


def settings(**changed: Any) -> ForwardLookingSettings:
    return ForwardLookingSettings(**(SMALL | changed))


CHANGES: list[dict[str, Any]] = [
    {"range": 20.0},
    {"range": 6.0, "min_range": 4.7},
    {"bin_count": 513},
    {"bin_count": 1},
    {"beam_count": 7},
    {"beam_width": 90 * DEG},
    {"beam_height": 60 * DEG},
    {"bearings": "equal_sine"},
    {"bearings": [-0.3, -0.1, 0.0, 0.05, 0.3]},
    {"normalization": "mean"},
    {"transfer": "sigmoid"},
    {"transfer": "sigmoid", "sigmoid_centre": 0.4},
    {"enable_attenuation": True},
    {"accuracy": 0.1},
    {"gain": 0.2},
    {"reduction": "gpu"},
    {},
]


def test_each_change_works_from_the_next_ping_as_if_the_sonar_were_new(make: Any) -> None:
    sonar = make(settings())
    scene = world(*TWO)
    for changed in CHANGES:
        change = {"normalization": "energy"} | changed
        sonar.ping(scene, pose())
        sonar.settings = settings(**change)
        fresh = make(settings(**change))
        made, truth = sonar.ping(scene, pose()), fresh.ping(scene, pose())
        made.validate()
        np.testing.assert_array_equal(made.bearings, truth.bearings)
        assert (made.beam_width, made.bin_duration) == (truth.beam_width, truth.bin_duration)
        assert made.bins.shape == truth.bins.shape
        # The search for a plan begins where it was: it may end one level apart, both within the accuracy asked for. A
        # mean says nothing of how much is in a bin, and a level more lights other bins at an edge: its sum is compared.
        energy = change["normalization"] == "energy"
        off = np.linalg.norm(made.bins - truth.bins) / np.linalg.norm(truth.bins)
        assert off <= 2 * sonar.settings.accuracy or not energy, change
        assert made.bins.sum() == pytest.approx(
            truth.bins.sum(), rel=2 * sonar.settings.accuracy if energy else 0.15
        ), change


def test_a_world_that_changes_is_seen_at_once(make: Any) -> None:
    sonar = make(settings(normalization="energy"))
    scene = world(*TWO)
    first = sonar.ping(scene, pose()).bins
    moved = np.eye(4)
    moved[:3, 3] = (3, 0, 0)
    scene.set_pose("body0", moved)
    nearer = sonar.ping(scene, pose()).bins
    assert nearer[:, 48:60].any()  # from 2.5 m on
    assert not first[:, 48:60].any()
    scene.set_material("body0", Material("quiet", 0.01))
    assert sonar.ping(scene, pose()).bins.sum() < 0.5 * nearer.sum()
    scene.remove("body0")
    alone = sonar.ping(scene, pose()).bins
    assert not alone[:, :100].any()
    scene.add(Body("ball", [Part(sphere(0.5), Material("plain"), np.eye(4))], moved))
    assert sonar.ping(scene, pose()).bins[:, 48:60].any()


def test_two_sonars_in_one_context_do_not_disturb_each_other(context: Any) -> None:
    one, other = ForwardLookingSonar(context, settings()), ForwardLookingSonar(context, settings(range=20.0))
    alone = one.ping(world(*TWO), pose()).bins
    other.ping(world(*STANDARD), pose((0, 0, 3), (0, 15, 0)))
    again = one.ping(world(*TWO), pose()).bins
    # Another world object is planned for anew, from the level in use: at most one level apart.
    assert np.linalg.norm(again - alone) <= 0.05 * np.linalg.norm(alone)
    one.release()
    assert other.ping(world(*STANDARD), pose((0, 0, 3), (0, 15, 0))).bins.any()
    other.release()


def test_truth_names_what_stands_in_each_lit_bin(make: Any) -> None:
    sonar = make(settings(normalization="energy"))
    scene = world(*TWO, floor(1.2))
    bins, truth = sonar.ping(scene, pose()).bins, sonar.truth(scene, pose())
    lit = bins > 0
    np.testing.assert_array_equal(truth.weight > 0, lit)
    assert set(np.unique(truth.object_id[lit])) <= {1, 2, 3}
    assert (truth.object_id[~lit] == 0).all()
    assert np.isnan(truth.elevation[~lit]).all()
    assert np.isnan(truth.range[~lit]).all()
    k = np.broadcast_to(np.arange(200), lit.shape)[lit]
    # Ranges lie in their bins, but for float32.
    assert (np.abs(truth.range[lit] / 0.05 - 0.5 - k) <= 0.501).all()
    on_floor = lit & (truth.object_id == 3)
    # The floor's elevation follows from the range; a bin's strongest sample is one row of some 0.3 deg.
    np.testing.assert_allclose(truth.elevation[on_floor], -np.arcsin(1.2 / truth.range[on_floor]), atol=0.5 * DEG)
    ball = lit & (truth.object_id == 1)
    # From its front at 4.6 m to its limb, but for half a bin, and for a cell that is cut by the limb a few bins more.
    assert truth.range[ball].min() == pytest.approx(4.6, abs=0.025)
    assert truth.range[ball].max() <= np.sqrt(26 - 0.25) + 0.2


def test_truth_is_empty_below_min_range_too(make: Any) -> None:
    sonar = make(settings(min_range=5.05))
    truth = sonar.truth(world(*TWO), pose())
    assert not truth.weight[:, :101].any()
    assert np.isnan(truth.range[:, :101]).all()


def test_the_shader_image_is_upright_and_from_left_to_right(make: Any) -> None:
    sonar = make(settings())
    sonar.ping(world((sphere(0.3), (5.0, 1.2, 0.5))), pose(time=77))
    frame = sonar.shader_image(77)
    strength, ranges, bearings = (
        (frame.data[:, :, k] for k in range(3)) if hasattr(frame, "data") else (frame.image[:, :, k] for k in range(3))
    )
    rows, columns = np.nonzero(np.isfinite(ranges))
    assert rows.mean() < 0.45 * ranges.shape[0]  # above the axis: upper rows
    assert columns.mean() < 0.5 * ranges.shape[1]  # to the left
    assert np.nanmin(ranges) == pytest.approx(np.sqrt(26.69) - 0.3, abs=0.02)
    assert np.nanmean(bearings) == pytest.approx(np.arctan2(1.2, 5.0), abs=0.02)
    assert np.nanmax(strength) <= 1


def test_a_black_image_says_why(make: Any) -> None:
    sonar = make(settings())
    for scene, words in (
        (World(), "no triangles"),
        (world(wall(50.0)), "no surface lies in the sector within 10 m"),
    ):
        assert any(words in line for line in sonar.remarks(sonar.ping(scene, pose())))
    assert sonar.remarks(sonar.ping(world(*TWO), pose())) == []
    assert len(sonar.explain()) >= 3


# Memory ----------------------------------------------------------------------------------------------------------


@pytest.fixture
def alive(context: Any) -> Callable[[], dict[str, int]]:
    """How many objects of each kind the driver holds in this context, asked from the driver itself."""
    library = ctypes.CDLL("libEGL.so.1")
    library.eglGetProcAddress.restype = ctypes.c_void_p

    def question(kind: str) -> Any:
        address = library.eglGetProcAddress(f"glIs{kind}".encode())
        return ctypes.CFUNCTYPE(ctypes.c_ubyte, ctypes.c_uint)(address)

    kinds = ("Buffer", "Texture", "Framebuffer", "Renderbuffer", "VertexArray", "Program", "Shader")
    asks = {kind: question(kind) for kind in kinds}
    return lambda: {kind: sum(map(ask, range(1, 20_000))) for kind, ask in asks.items()}


def exercise(sonar: ForwardLookingSonar, rounds: int) -> None:
    for number in range(rounds):
        odd = number % 2
        sizes = {"bin_count": 150 + number % 3, "beam_count": 20 + number % 5, "range": 8.0 + odd}
        ways = {"reduction": ("cpu", "gpu")[odd], "normalization": ("mean", "energy")[odd]}
        sonar.settings = settings(**sizes, **ways)
        scene = world(*TWO[: 1 + odd])
        sonar.ping(scene, pose())
        sonar.truth(scene, pose())


def test_settings_and_worlds_that_change_leave_nothing_behind_on_the_graphics_card(
    context: Any, make: Any, alive: Any
) -> None:
    sonar = make(settings())
    exercise(sonar, 4)
    before = alive()
    exercise(sonar, 12)
    assert alive() == before


def test_a_released_sonar_leaves_nothing_behind(context: Any, alive: Any) -> None:
    counts = []
    for _ in range(4):
        sonar = ForwardLookingSonar(context, settings())
        exercise(sonar, 2)
        sonar.release()
        counts.append(alive())
    # The program used last stays until another one is used.
    assert counts[1] == counts[3]


def test_memory_is_flat_over_frames(make: Any) -> None:
    # A coarse accuracy keeps to one level of samples, whose tables are kept; a finer one may add others now and then.
    sonar, scene = make(settings(accuracy=0.2)), world(*TWO)
    at = [pose((0.01 * n, 0, 0), (0, 0, n % 5)) for n in range(50)]

    def resident() -> int:
        gc.collect()
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * 4096

    for each in at * 6:  # past the first look at the plan
        sonar.ping(scene, each)
    before = resident()
    for each in at * 10:
        sonar.ping(scene, each)
    # 500 frames of 25 kB each would be 12 MB if they were kept; pages of the allocator come and go by some hundred kB.
    assert resident() - before < 3_000_000


def test_what_comes_into_view_is_looked_at_again_and_what_stands_still_is_not(make: Any) -> None:
    """A flat floor is exact on few samples; heaps of balls are not."""
    sonar = make(settings(normalization="energy"))
    heap = [(sphere(0.15), (30.0 + x, y, -1.0)) for x in np.arange(3, 8, 0.8) for y in np.arange(-3, 3.5, 0.8)]
    scene = world(floor(1.2), *heap)
    sonar.ping(scene, pose())
    alone = sonar._imager._level
    for step in range(200):
        sonar.ping(scene, pose((0.15 * step, 0, 0)))
    among = sonar._imager._level
    assert among > alone
    planned = sonar._imager._planned_from
    for _ in range(700):
        sonar.ping(scene, pose((30.0, 0, 0)))
    assert sonar._imager._planned_from is not planned  # it stands elsewhere than at its last look, once
    planned = sonar._imager._planned_from
    for _ in range(700):
        sonar.ping(scene, pose((30.0, 0, 0)))
    assert sonar._imager._planned_from is planned


@pytest.mark.parametrize("change", [{"range": 6.0}, {"beam_count": 7}, {"bin_count": 50}, {"gain": 0.2}], ids=str)
def test_one_setting_assigned_in_place_works_as_all_of_them_assigned(make: Any, change: dict[str, Any]) -> None:
    energy = {"normalization": "energy"}
    sonar, scene = make(settings(**energy)), world(*TWO)
    sonar.ping(scene, pose())
    for name, value in change.items():
        setattr(sonar.settings, name, value)
    made, truth = sonar.ping(scene, pose()), make(settings(**energy | change)).ping(scene, pose())
    np.testing.assert_array_equal(made.bearings, truth.bearings)
    assert made.bins.shape == truth.bins.shape
    # A plan in use is left for a lower one only with room to spare, so the samples may be others: both meet 0.02.
    assert np.linalg.norm(made.bins - truth.bins) <= 0.04 * np.linalg.norm(truth.bins)
    kept = made.bins.shape
    with pytest.raises(ValueError, match="must be"):
        sonar.settings.range = -1.0
    assert sonar.ping(scene, pose()).bins.shape == kept
