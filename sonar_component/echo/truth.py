"""What stands behind each bin: the sample that gives it most, with its elevation, range and body."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from sonar_component.echo.assignment import Assignment
from sonar_component.echo.binning import MOST, Scale


@dataclass(frozen=True)
class Truth:
    """Per bin, all (beams, bins).

    Attributes
    ----------
    elevation : float32
        Of the sample with the greatest solid angle in the bin [rad]; NaN where the bin is empty.
    range : float32
        Of that sample, inside the bin [m]; NaN where the bin is empty.
    object_id : int32
        Its body, counted from 1 in the order of the world; 0 where the bin is empty.
    weight : float32
        Solid angle of all surfaces in the bin [sr].
    """

    elevation: NDArray[np.float32]
    range: NDArray[np.float32]
    object_id: NDArray[np.int32]
    weight: NDArray[np.float32]


def strongest_samples(
    pixels: NDArray[np.uint32], layout: Any, assignment: Assignment, scale: Scale, weight: NDArray[np.float32]
) -> Truth:
    """Find the strongest sample of each bin.

    Parameters
    ----------
    pixels : (columns, rows, 4) uint32
        As the fragment shader writes them with TRUTH on.
    layout : render.layout.Layout
    weight : (beams, bins) float32
        From ``bin_footprints`` on the same pixels [sr].
    """
    shape = weight.shape
    best = np.zeros(shape, np.float32)
    elevation, distance = np.full(shape, np.nan, np.float32), np.full(shape, np.nan, np.float32)
    object_id = np.zeros(shape, np.int32)
    ranges = np.ascontiguousarray(pixels[:, :, 0]).view(np.float32)
    spans = ((pixels[:, :, 1] >> 16 & 0x7FFF) / 32767.0) ** 2 * MOST
    _strongest(
        ranges, spans, pixels[:, :, 2], layout.elevations(), layout.solid_angle, assignment.start,
        assignment.column, assignment.share, scale.range_max / scale.bin_count, best, elevation, distance, object_id,
    )  # fmt: skip
    empty = weight <= 0
    elevation[empty], distance[empty], object_id[empty] = np.nan, np.nan, 0
    return Truth(elevation, distance, object_id, weight)


@numba.njit(nogil=True, cache=True)  # type: ignore[untyped-decorator]
def _strongest(
    ranges: Any, spans: Any, ids: Any, elevations: Any, solid_angle: Any, start: Any, column: Any, share: Any,
    bin_length: float, best: Any, elevation: Any, distance: Any, object_id: Any,
) -> None:  # fmt: skip
    beams, bins = best.shape
    for beam in range(beams):
        for entry in range(start[beam], start[beam + 1]):
            c = column[entry]
            for row in range(ranges.shape[1]):
                r = ranges[c, row]
                whole = solid_angle[c, row] * share[entry]
                if r <= 0 or whole <= 0:
                    continue
                span = spans[c, row]  # as in binning.py: the inverse of the range is linear
                low, high = r / (1 + span / 2), r / (1 - span / 2)
                for k in range(max(0, int(low / bin_length)), min(bins - 1, int(high / bin_length)) + 1):
                    near, far = max(low, k * bin_length), min(high, (k + 1) * bin_length)
                    part = whole * (1 / near - 1 / far) / (1 / low - 1 / high) if high > low else whole
                    if part > best[beam, k]:
                        best[beam, k] = part
                        elevation[beam, k] = elevations[c, row]
                        distance[beam, k] = (near + far) / 2
                        object_id[beam, k] = ids[c, row]
