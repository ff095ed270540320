"""The compute shader against the plain loop and against the compiled one."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sonar_component.echo.assignment import Assignment
from sonar_component.echo.binning import EMPTY, Scale, bin_footprints
from sonar_component.echo.reduction import GpuReduction
from tests.reference import binning, texels

RANGE = 30.0  # [m]
# [-], of a beam: float32 places an edge to 1e-4 of a bin at bin 1500, a quarter of a per cent of the shortest footprint
# below (0.05 bins), which is one of the 64 samples of its beam. Rounding to 2^-31 of a beam is far below.
PLACED = 5e-5
BEAMS, COLUMNS, ROWS = 6, 24, 16


class Fan:
    """Random samples in beams that share columns, as tables for both ways and as a texture."""

    def __init__(self, context: Any, seed: int, beams: int = BEAMS, columns: int = COLUMNS, rows: int = ROWS) -> None:
        rng = np.random.default_rng(seed)
        first, last = rng.integers(0, 3, columns, np.int32), rng.integers(rows - 3, rows, columns, np.int32)
        clips = rng.uniform(0, 0.95, (2, columns)).astype(np.float32)
        solid_angle = rng.uniform(0.5, 1.5, (columns, rows)).astype(np.float32) / (columns * rows)
        self.layout = SimpleNamespace(
            columns=columns, rows=rows, solid_angle=solid_angle,
            first_row=first, last_row=last, first_clip=clips[0], last_clip=clips[1],
        )  # fmt: skip
        # Neighbouring beams share the column between them.
        starts = np.linspace(0, columns, beams + 1).astype(int)
        runs = [np.arange(a, min(b + 1, columns)) for a, b in pairwise(starts)]
        column = np.concatenate(runs).astype(np.int32)
        start = np.concatenate([[0], np.cumsum([len(run) for run in runs])]).astype(np.int64)
        self.assignment = Assignment(start, column, rng.uniform(0.2, 1, len(column)).astype(np.float32))
        per_entry = solid_angle.sum(axis=1)[column] * self.assignment.share
        self.whole = np.add.reduceat(per_entry, start[:-1]).astype(np.float64)
        ranges = np.maximum(rng.uniform(-3, 1.2 * RANGE, (columns, rows)), 0)
        extents, falling = 10.0 ** rng.uniform(-3, 1.5, ranges.shape), rng.random(ranges.shape) < 0.5
        self.pixels = texels.pack(ranges, extents, rng.random(ranges.shape), falling, 1.0)
        self.texture = context.texture((rows, columns), 2, self.pixels.tobytes(), dtype="u4")

    def on_gpu(self, reduction: GpuReduction, scale: Scale) -> np.ndarray:
        return reduction.bins(self.texture, self.layout, self.assignment, self.whole, scale)

    def on_cpu(self, scale: Scale) -> tuple[np.ndarray, np.ndarray]:
        return bin_footprints(self.pixels, self.layout, self.assignment, self.whole, scale, want_weight=True)


@pytest.fixture
def reduction(context: Any) -> Iterator[GpuReduction]:
    made = GpuReduction(context)
    yield made
    made.release()


@pytest.fixture
def fan(context: Any) -> Iterator[Fan]:
    made = Fan(context, 1)
    yield made
    made.texture.release()


@pytest.mark.parametrize("bins", [1, 2, 399, 513, 1500])
@pytest.mark.parametrize("linear", [True, False])
def test_energies_are_those_of_the_plain_loop(reduction: GpuReduction, fan: Fan, bins: int, linear: bool) -> None:
    weight, energy = binning.sums(fan.pixels, fan.layout, fan.assignment, BEAMS, bins, RANGE, linear=linear)
    made = fan.on_gpu(reduction, Scale(bins, RANGE, mean=False, linear=linear))
    lit = weight > 2 * EMPTY * fan.whole[:, None]  # beside the threshold rounding decides
    # One unit of 2^-31 for each of the 70 samples of a beam is nothing beside how float32 places edges.
    np.testing.assert_allclose(made[lit], (energy / fan.whole[:, None])[lit], rtol=1e-5, atol=PLACED)
    assert not made[weight == 0].any()


@pytest.mark.parametrize("bins", [2, 399, 1500])
@pytest.mark.parametrize("min_range", [0.0, 7.7])
def test_the_mean_is_that_of_the_compiled_loop(reduction: GpuReduction, fan: Fan, bins: int, min_range: float) -> None:
    scale = Scale(bins, RANGE, min_range, mean=True)
    (on_cpu, weight), on_gpu = fan.on_cpu(scale), fan.on_gpu(reduction, scale)
    well_lit = weight > 1e-3 * fan.whole[:, None]  # a mean of less moves with where float32 places an edge
    assert on_gpu[well_lit] == pytest.approx(on_cpu[well_lit], abs=PLACED / 1e-3)
    assert not on_gpu[:, : int(np.ceil(min_range / RANGE * bins - 1e-6))].any()


def test_the_same_samples_give_the_same_bits_again(reduction: GpuReduction, fan: Fan) -> None:
    scale = Scale(399, RANGE)
    first = fan.on_gpu(reduction, scale)
    assert all(fan.on_gpu(reduction, scale).tobytes() == first.tobytes() for _ in range(5))


def test_nothing_is_left_of_the_image_before(context: Any, reduction: GpuReduction, fan: Fan) -> None:
    fan.on_gpu(reduction, Scale(399, RANGE))
    nothing = context.texture((ROWS, COLUMNS), 2, np.zeros_like(fan.pixels).tobytes(), dtype="u4")
    assert not reduction.bins(nothing, fan.layout, fan.assignment, fan.whole, Scale(399, RANGE)).any()
    nothing.release()


def test_other_bins_beams_and_layouts_are_taken_over_at_once(context: Any, reduction: GpuReduction, fan: Fan) -> None:
    other = Fan(context, 2, beams=3, columns=40, rows=70)
    for which, bins in ((fan, 100), (other, 100), (other, 513), (fan, 2), (fan, 100)):
        made = which.on_gpu(reduction, Scale(bins, RANGE, mean=False))
        np.testing.assert_allclose(made, which.on_cpu(Scale(bins, RANGE, mean=False))[0], rtol=1e-5, atol=PLACED)
    other.texture.release()


def test_strengths_above_one_are_scaled_alike(reduction: GpuReduction, fan: Fan) -> None:
    plain, scaled = (fan.on_gpu(reduction, Scale(100, RANGE, strength_max=s, mean=False)) for s in (1.0, 8.0))
    np.testing.assert_array_equal(scaled, 8 * plain)


def test_more_beams_than_one_direction_of_work_groups_holds(context: Any, reduction: GpuReduction) -> None:
    # 70000 entries: OpenGL guarantees 65535 groups in a direction.
    entries, rows = 70_000, 2
    layout = SimpleNamespace(
        columns=1, rows=rows, solid_angle=np.full((1, rows), 0.5, np.float32),
        first_row=np.zeros(1, np.int32), last_row=np.ones(1, np.int32),
        first_clip=np.zeros(1, np.float32), last_clip=np.zeros(1, np.float32),
    )  # fmt: skip
    assignment = Assignment(np.arange(entries + 1), np.zeros(entries, np.int32), np.ones(entries, np.float32))
    texture = context.texture((rows, 1), 2, texels.pack([[10.5, 20.5]], 0.1, 0.5, False, 1.0).tobytes(), dtype="u4")
    made = reduction.bins(texture, layout, assignment, np.ones(entries), Scale(30, RANGE, mean=False))
    expected = np.zeros(30)
    expected[[10, 20]] = 0.25
    # The root of the strength has 16 bits, 1e-5 of it here.
    np.testing.assert_allclose(made, np.broadcast_to(expected, made.shape), atol=1e-5)
    texture.release()
