"""The strongest sample of each bin, found by a plain loop over all samples."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from sonar_component.echo.assignment import Assignment
from sonar_component.echo.binning import Scale, bin_footprints
from sonar_component.echo.truth import strongest_samples
from tests.reference import texels

RANGE, BINS, COLUMNS, ROWS, BEAMS = 30.0, 60, 12, 16, 4
DR = RANGE / BINS


def test_each_lit_bin_names_the_sample_that_gives_it_most() -> None:
    rng = np.random.default_rng(4)
    elevations = np.sort(rng.uniform(-0.2, 0.2, (COLUMNS, ROWS)), axis=1)
    layout = SimpleNamespace(
        columns=COLUMNS, rows=ROWS, solid_angle=rng.uniform(0.5, 1.5, (COLUMNS, ROWS)).astype(np.float32) / 200,
        first_row=np.zeros(COLUMNS, np.int32), last_row=np.full(COLUMNS, ROWS - 1, np.int32),
        first_clip=np.zeros(COLUMNS, np.float32), last_clip=np.zeros(COLUMNS, np.float32),
        elevations=lambda: elevations,
    )  # fmt: skip
    share = rng.uniform(0.3, 1, COLUMNS).astype(np.float32)
    assignment = Assignment(np.arange(BEAMS + 1) * 3, np.arange(COLUMNS, dtype=np.int32), share)
    ranges = np.maximum(rng.uniform(-3, 1.1 * RANGE, (COLUMNS, ROWS)), 0)
    ids = rng.integers(1, 9, ranges.shape).astype(np.uint32)
    words = texels.pack(ranges, 10.0 ** rng.uniform(-2, 0.7, ranges.shape), 0.5, False, 1.0)
    pixels = np.concatenate([words, ids[:, :, None], np.zeros_like(ids)[:, :, None]], axis=2)
    scale = Scale(BINS, RANGE, min_range=2.0)
    _, weight = bin_footprints(pixels, layout, assignment, np.full(BEAMS, 0.2), scale, want_weight=True)
    truth = strongest_samples(pixels, layout, assignment, scale, weight)

    for beam in range(BEAMS):
        for k in range(BINS):
            parts = {}
            for column in range(3 * beam, 3 * beam + 3):
                for row in range(ROWS):
                    sample = texels.unpack(words[column, row], 1.0)
                    if not sample.range > 0:
                        continue
                    half = sample.extent / sample.range / 2
                    low, high = sample.range / (1 + half), sample.range / (1 - half)
                    near, far = max(low, k * DR), min(high, (k + 1) * DR)
                    if far > near:  # of equal parts in the inverse of the range
                        whole = layout.solid_angle[column, row] * share[column]
                        parts[column, row] = (whole * (1 / near - 1 / far) / (1 / low - 1 / high), near, far)
            if not parts or k < 4:  # bins below min_range are empty
                assert truth.object_id[beam, k] == 0
                assert np.isnan(truth.elevation[beam, k])
                assert np.isnan(truth.range[beam, k])
                continue
            best = max(parts, key=lambda place: parts[place][0])
            assert truth.object_id[beam, k] == ids[best]
            assert truth.elevation[beam, k] == np.float32(elevations[best])
            assert abs(truth.range[beam, k] - (parts[best][1] + parts[best][2]) / 2) < 1e-4  # float32 at 30 m
    np.testing.assert_array_equal(truth.weight, weight)
