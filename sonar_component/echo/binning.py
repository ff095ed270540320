"""Samples to beams x bins on the CPU: each footprint is spread over the bins that it covers.

A cell whose surface spans the ranges [r - g/2, r + g/2] gives each bin its solid angle times the part of the span that
lies in the bin. Bins are added to directly: nothing is ever subtracted, so no residue is left behind a strong echo.

numba compiles the loop: with a software driver it is the fastest way measured here, 4 ns a sample against 28 ns for four
numpy.bincount calls and 50 ns for atomics in a compute shader on llvmpipe. On hardware the shader in reduction.py wins.
Beams are shared among Python threads (the loop holds no GIL) and not by numba's own pool, whose default layer must not be
entered from two tasks at once.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from sonar_component.echo.assignment import Assignment


@numba.njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _bin_beams(
    begin: int,
    end: int,
    ranges: Any,
    codes: Any,
    stride: int,
    components: int,
    solid_angle: Any,
    first_row: Any,
    last_row: Any,
    first_clip: Any,
    last_clip: Any,
    start: Any,
    column: Any,
    share: Any,
    bins_per_metre: float,
    range_max: float,
    strength_max: float,
    min_range: float,
    weight: Any,
    energy: Any,
) -> None:
    bin_count = weight.shape[1]
    lowest = min_range * bins_per_metre
    strength_scale = np.float32(strength_max / (65535.0 * 65535.0))
    extent_scale = np.float32(range_max * bins_per_metre / (32767.0 * 32767.0))
    metre = np.float32(bins_per_metre)
    for beam in range(begin, end):
        for entry in range(start[beam], start[beam + 1]):
            c = column[entry]
            part = share[entry]
            first, last = first_row[c], last_row[c]
            for row in range(first, last + 1):
                index = row * stride + c
                r = ranges[index * components]
                if r <= np.float32(0.0):
                    continue
                code = codes[index * components]
                root = np.float32(code & np.uint32(0xFFFF))
                strength = root * root * strength_scale
                root = np.float32((code >> np.uint32(16)) & np.uint32(0x7FFF))
                extent = root * root * extent_scale
                w = solid_angle[index] * part
                low = r * metre - np.float32(0.5) * extent
                high = low + extent
                if row == first or row == last:
                    # Only a part of the cell lies inside the aperture: cut the same part off its span in range.
                    below = first_clip[c] if row == first else np.float32(0.0)
                    above = last_clip[c] if row == last else np.float32(0.0)
                    if code & np.uint32(0x80000000):
                        below, above = above, below
                    low, high = low + below * extent, high - above * extent
                if high < lowest or low >= bin_count:
                    continue
                k_low, k_high = int(np.floor(low)), int(np.floor(high))
                if k_low == k_high:
                    if k_low >= 0 and low >= lowest:
                        weight[beam, k_low] += w
                        energy[beam, k_low] += w * strength
                    continue
                density = w / (high - low)
                for k in range(max(k_low, 0, int(lowest)), min(k_high, bin_count - 1) + 1):
                    covered = (min(high, np.float32(k + 1)) - max(low, np.float32(k))) * density
                    weight[beam, k] += covered
                    energy[beam, k] += covered * strength


def bin_footprints(
    pixels: NDArray[np.uint32],
    layout: Any,
    assignment: Assignment,
    bin_count: int,
    range_max: float,
    strength_max: float,
    min_range: float = 0.0,
    pool: ThreadPoolExecutor | None = None,
    workers: int = 1,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Spread the footprints of all samples over beams x bins.

    Parameters
    ----------
    pixels : (rows, columns, 2 or 4) uint32
        As the fragment shader writes them: render/shaders/footprint.frag.
    layout : render.layout.Layout
        Where the samples lie.
    range_max : float
        End of the last bin [m].
    strength_max : float
        Scale of the strengths in ``pixels`` [-].
    min_range : float
        Bins that begin below it stay empty [m].

    Returns
    -------
    weight : (beams, bins) float32
        Solid angle of the surface seen in each bin [sr].
    energy : (beams, bins) float32
        The same, each part times its echo strength [sr].
    """
    beams = len(assignment.start) - 1
    weight = np.zeros((beams, bin_count), np.float32)
    energy = np.zeros((beams, bin_count), np.float32)
    flat = np.ascontiguousarray(pixels).reshape(-1)
    rest = (
        flat.view(np.float32), flat[1:], layout.columns, pixels.shape[2], layout.solid_angle.reshape(-1),
        layout.first_row, layout.last_row, layout.first_clip, layout.last_clip,
        assignment.start, assignment.column, assignment.share,
        bin_count / range_max, range_max, strength_max, min_range, weight, energy,
    )  # fmt: skip
    if pool is None or workers < 2 or beams < 2 * workers:
        _bin_beams(0, beams, *rest)
    else:
        # Equal numbers of entries, so that no worker waits for another.
        cuts = np.searchsorted(assignment.start, np.linspace(0, assignment.start[-1], workers + 1))
        cuts[0], cuts[-1] = 0, beams
        jobs = [pool.submit(_bin_beams, int(a), int(b), *rest) for a, b in zip(cuts[:-1], cuts[1:], strict=True)]
        for job in jobs:
            job.result()
    return weight, energy
