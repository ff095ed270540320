"""The compiled loop against a plain one, and against what can be said without either."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sonar_component.echo.assignment import Assignment
from sonar_component.echo.binning import EMPTY, Scale, bin_footprints
from tests.reference import binning, texels

RANGE = 30.0  # [m]
# [-], of a beam: float32 places an edge to 1e-4 of a bin at bin 1500, a quarter of a per cent of the shortest footprint
# below (0.05 bins), which is one of the 64 samples of its beam.
PLACED = 5e-5


def grid(columns: int, rows: int, rng: np.random.Generator | None = None) -> Any:
    """Samples of equal solid angle, 1 sr in all, or of random ones with parts outside the aperture."""
    solid_angle = np.full((columns, rows), 1 / (columns * rows), np.float32)
    clips = np.zeros((2, columns), np.float32)
    first, last = np.zeros(columns, np.int32), np.full(columns, rows - 1, np.int32)
    if rng is not None:
        solid_angle *= rng.uniform(0.5, 1.5, solid_angle.shape).astype(np.float32)
        clips = rng.uniform(0, 0.95, (2, columns)).astype(np.float32)
        first, last = rng.integers(0, 3, columns, np.int32), rng.integers(rows - 3, rows, columns, np.int32)
    return SimpleNamespace(
        columns=columns, rows=rows, solid_angle=solid_angle,
        first_row=first, last_row=last, first_clip=clips[0], last_clip=clips[1],
    )  # fmt: skip


def beams_of(layout: Any, beams: int, rng: np.random.Generator | None = None) -> tuple[Assignment, np.ndarray]:
    """Equal runs of columns, and the solid angle of each beam."""
    column = np.arange(layout.columns, dtype=np.int32)
    share = np.ones(layout.columns, np.float32) if rng is None else rng.uniform(0.2, 1, layout.columns)
    start = np.linspace(0, layout.columns, beams + 1).astype(np.int64)
    whole = np.add.reduceat(layout.solid_angle.sum(axis=1) * share, start[:-1]).astype(np.float64)
    return Assignment(start, column, share.astype(np.float32)), whole


def echoes(ranges: Any, extents: Any, strengths: Any = 1.0, *, bins: int, mean: bool = False, **scale: Any) -> Any:
    """Bins of one beam that hears these samples, all of equal solid angle."""
    ranges, extents, strengths = np.broadcast_arrays(np.atleast_1d(ranges), extents, strengths)
    layout = grid(1, max(2, len(ranges)))
    ranges, extents, strengths = (np.resize(x, (1, layout.rows)) for x in (ranges, extents, strengths))
    pixels = texels.pack(ranges, extents, strengths, False, 1.0)
    bins_, _ = bin_footprints(pixels, layout, *beams_of(layout, 1), Scale(bins, RANGE, mean=mean, **scale))
    return bins_[0]


@pytest.mark.parametrize("bins", [1, 2, 301, 399, 511, 513, 1500])
@pytest.mark.parametrize("mean", [True, False])
@pytest.mark.parametrize("linear", [True, False])
def test_random_samples_give_what_the_plain_loop_gives(bins: int, mean: bool, linear: bool) -> None:
    rng = np.random.default_rng(bins)
    layout = grid(24, 16, rng)
    ranges = rng.uniform(-2, 1.2 * RANGE, (24, 16)) * (rng.random((24, 16)) > 0.2)
    extents = 10.0 ** rng.uniform(-3, 1.5, ranges.shape)  # [m], as walls and grazing floors have
    falling = rng.random(ranges.shape) < 0.5
    pixels = texels.pack(np.maximum(ranges, 0), extents, rng.random(ranges.shape), falling, 1)
    assignment, whole = beams_of(layout, 6, rng)
    weight, energy = binning.sums(pixels, layout, assignment, 6, bins, RANGE, min_range=0.5, linear=linear)
    scale = Scale(bins, RANGE, min_range=0.5, mean=mean, linear=linear)
    made, heard = bin_footprints(pixels, layout, assignment, whole, scale, want_weight=True)
    np.testing.assert_allclose(heard, weight, rtol=1e-5, atol=PLACED * whole.max())
    # A mean of a bin that is hardly touched says little: compare what it is the mean of.
    np.testing.assert_allclose(made * (heard if mean else whole[:, None]), energy, rtol=1e-5, atol=PLACED * whole.max())
    assert not made[weight == 0].any()


def test_threads_give_the_same_bits_as_one() -> None:
    rng = np.random.default_rng(1)
    layout = grid(1024, 128, rng)  # enough for three threads to be worth it
    ranges = rng.uniform(1, RANGE, (1024, 128))
    pixels = texels.pack(ranges, rng.uniform(0, 3, ranges.shape), rng.random(ranges.shape), False, 1)
    assignment, whole = beams_of(layout, 64, rng)
    alone, _ = bin_footprints(pixels, layout, assignment, whole, Scale(500, RANGE))
    with ThreadPoolExecutor(3) as pool:
        shared, _ = bin_footprints(pixels, layout, assignment, whole, Scale(500, RANGE), pool)
    assert alone.tobytes() == shared.tobytes()


def test_an_echo_on_an_edge_belongs_to_the_farther_bin() -> None:
    for k in (0, 1, 7, 150, 299):
        bins = echoes(k * RANGE / 300, 0.0, bins=300)  # 0.1 m is not a binary number, k / 10 is the nearest float32
        if k == 0:
            assert not bins.any()  # range 0 is a miss
        else:
            assert np.flatnonzero(bins).tolist() == [k]


def test_an_echo_at_the_end_of_the_last_bin_or_beyond_is_not_heard() -> None:
    for beyond in (RANGE, RANGE + 1e-3, 1.24 * RANGE, np.inf, np.nan):
        assert not echoes(beyond, 0.0, bins=300).any()


@pytest.mark.parametrize("bins", [1, 3, 300, 1500, 4096])
def test_a_surface_of_one_range_keeps_its_whole_energy_in_one_bin(bins: int) -> None:
    for k in np.unique(np.linspace(0, bins - 1, 7).astype(int)):
        made = echoes((k + 0.37) * RANGE / bins, 0.0, 0.81, bins=bins)
        assert np.flatnonzero(made).tolist() == [k]
        assert made[k] == pytest.approx(0.81, rel=5e-5)  # the strength's root has 16 bits: 2 / 65535 / 0.9 / 2 = 1.7e-5


@pytest.mark.parametrize("extent_bins", [0.3, 1.0, 2.5, 3.0, 4.0, 40.0, 290.0])
def test_a_footprint_gives_each_bin_its_share(extent_bins: float) -> None:
    at = 150.2
    made = echoes(at * 0.1, extent_bins * 0.1, bins=300)
    # A plane's inverse range is linear over the cell: its ends, and the bins' edges between them.
    half = min(extent_bins / at, 1.9) / 2  # a facet seen on edge ends somewhere
    near, far = (1 + half) / at, (1 - half) / at
    edges = 1 / np.maximum(np.arange(301), 1e-9)
    inside = np.clip(np.minimum(edges[:-1], near) - np.maximum(edges[1:], far), 0, None)
    rounded = 1 / (32767 * np.sqrt(extent_bins / 300))  # [-], of the extent, whose root has 15 bits
    np.testing.assert_allclose(made, inside / (near - far), atol=rounded)
    if 1 / far < 300:  # then nothing of the energy is lost, but for float32's 1e-7 of ranges that differ by 0.2 %
        assert made.sum() == pytest.approx(1, rel=1e-4)


def test_one_footprint_of_a_floor_gives_each_bin_what_the_floor_does() -> None:
    """A floor h below, seen between two elevations: sin(elevation) = h / r is linear, and the cosine of incidence."""
    h, near, far = 1.0, 8.0, 12.0  # [m]
    middle = 2 / (1 / near + 1 / far)
    extent = middle**2 * (1 / near - 1 / far)
    made = echoes(middle, extent, h / middle, bins=300, linear=True)
    edges = np.linspace(0, RANGE, 301)
    begin, end = np.clip(edges[:-1], near, far), np.clip(edges[1:], near, far)
    # Integral of h/r over d(h/r), relative to that of d(h/r).
    truth = (h / begin**2 - h / end**2) / 2 / (1 / near - 1 / far)
    # Roots of 15 and 16 bits: 1e-4 of the extent moves its ends by 0.004 of the end bins, and 5e-5 of the strength.
    np.testing.assert_allclose(made[81:119], truth[81:119], rtol=3e-4)
    np.testing.assert_allclose(made, truth, atol=0.01 * truth.max())


def test_large_echoes_leave_no_residue_behind_them() -> None:
    # A wall of full strength from 1.8 m, 2.5 / (1 + 2 / 5), to 4.2 m, 2.5 / (1 - 2 / 5), as sums and differences add
    # it, and nothing behind: exactly nothing.
    made = echoes(np.full(64, 2.5), np.linspace(1, 2, 64), bins=300, mean=True)
    assert made[18:41].all()
    assert not made[43:].any()


def test_the_mean_of_equal_strengths_is_that_strength_however_little_is_seen() -> None:
    made = echoes(np.linspace(5, 25, 200), 0.3, 0.25, bins=300, mean=True)
    assert made[made > 0] == pytest.approx(0.25, rel=2e-4)  # float32 sums of weights from 1e-5 to 1e-2
    assert (made[52:248] > 0).all()


def test_bins_that_begin_below_min_range_stay_empty_and_the_others_are_unchanged() -> None:
    free = echoes(np.linspace(1, 29, 100), 0.5, bins=300)
    cut = echoes(np.linspace(1, 29, 100), 0.5, bins=300, min_range=10.05)
    assert not cut[:101].any()  # bin 100 begins at 10 m, below 10.05 m
    np.testing.assert_allclose(cut[101:], free[101:], rtol=1e-6)  # float32, summed from elsewhere


def test_min_range_on_an_edge_keeps_the_bin_that_begins_there() -> None:
    made = echoes(np.linspace(1, 29, 100), 0.5, bins=300, min_range=0.1 * 77)
    assert np.flatnonzero(made)[0] == 77


@pytest.mark.parametrize(("share", "lit"), [(0.5, [100]), (2.0, [100, 200])])
def test_a_bin_with_less_than_the_stated_share_of_the_beam_is_empty(share: float, lit: list[int]) -> None:
    layout = grid(1, 2)
    layout.solid_angle[:] = [[1 - share * EMPTY, share * EMPTY]]
    pixels = texels.pack([[10.05, 20.05]], 0.0, 1.0, False, 1.0)
    bins, _ = bin_footprints(pixels, layout, *beams_of(layout, 1), Scale(300, RANGE))
    assert np.flatnonzero(bins).tolist() == lit


def test_no_samples_give_exactly_nothing() -> None:
    layout = grid(8, 16)
    assignment, whole = beams_of(layout, 4)
    pixels = np.zeros((8, 16, 2), np.uint32)
    for mean in (True, False):
        bins, weight = bin_footprints(pixels, layout, assignment, whole, Scale(50, RANGE, mean=mean), want_weight=True)
        assert not bins.any()
        assert not weight.any()


def test_a_beam_without_columns_is_empty_and_its_neighbours_are_not() -> None:
    layout = grid(2, 4)
    assignment = Assignment(np.array([0, 1, 1, 2]), np.array([0, 1], np.int32), np.ones(2, np.float32))
    pixels = texels.pack(np.full((2, 4), 10.0), 0.1, 1.0, False, 1.0)
    bins, _ = bin_footprints(pixels, layout, assignment, np.full(3, 0.5), Scale(300, RANGE, mean=False))
    assert bins.sum(axis=1).tolist() == pytest.approx([1, 0, 1])


def test_pixels_with_truth_words_give_the_same_bits() -> None:
    rng = np.random.default_rng(5)
    layout = grid(8, 16, rng)
    pixels = texels.pack(rng.uniform(1, RANGE, (8, 16)), 0.3, 0.5, False, 1.0)
    with_truth = np.concatenate([pixels, np.ones_like(pixels)], axis=2)
    assignment, whole = beams_of(layout, 4)
    plain, _ = bin_footprints(pixels, layout, assignment, whole, Scale(300, RANGE))
    assert plain.tobytes() == bin_footprints(with_truth, layout, assignment, whole, Scale(300, RANGE))[0].tobytes()
