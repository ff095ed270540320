"""Footprints to bins, one sample and one bin at a time in float64: truth for echo/binning.py and bin.comp."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.reference.texels import unpack

LEAST = 1e-3  # [bins], least span of a sample in range, as both implementations state it
EMPTY = 3e-6  # [-], of the beam's solid angle, below which a bin counts as empty


def sums(
    pixels: np.ndarray, layout: Any, assignment: Any, beams: int, bins: int, range_max: float, min_range: float = 0.0,
    strength_max: float = 1.0,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Solid angle [sr] and solid angle times strength [sr] in each bin, (beams, bins) float64 each."""
    weight, energy = np.zeros((beams, bins)), np.zeros((beams, bins))
    for beam in range(beams):
        for entry in range(assignment.start[beam], assignment.start[beam + 1]):
            column = int(assignment.column[entry])
            for row in range(layout.first_row[column], layout.last_row[column] + 1):
                sample = unpack(pixels[column, row], range_max, strength_max)
                if not sample.range > 0:
                    continue
                solid_angle = float(layout.solid_angle[column, row]) * float(assignment.share[entry])
                low, high = _span(sample, layout, column, row, range_max / bins)
                for k in range(max(0, int(np.floor(low))), min(bins, int(high) + 1)):
                    if k * range_max / bins < min_range * (1 - 1e-9):
                        continue
                    part = solid_angle * max(0.0, min(high, k + 1) - max(low, k)) / (high - low)
                    weight[beam, k] += part
                    energy[beam, k] += part * sample.strength
    return weight, energy


def image(weight: np.ndarray, energy: np.ndarray, beam_solid_angle: np.ndarray, mean: bool) -> np.ndarray:
    """The mean of the strength over the surface in a bin, or the energy relative to the beam; 0 in an empty bin."""
    whole = np.broadcast_to(beam_solid_angle[:, None], weight.shape)
    return np.where(weight > EMPTY * whole, energy / np.where(mean, np.maximum(weight, 1e-300), whole), 0.0)


def _span(sample: Any, layout: Any, column: int, row: int, bin_length: float) -> tuple[float, float]:
    """Ranges that the part of the cell inside the aperture covers [bins]."""
    extent = max(sample.extent / bin_length, LEAST)
    low = (sample.range - sample.extent / 2) / bin_length
    below = float(layout.first_clip[column]) if row == layout.first_row[column] else 0.0
    above = float(layout.last_clip[column]) if row == layout.last_row[column] else 0.0
    near, far = (above, below) if sample.falling else (below, above)
    return low + near * extent, low + max(1 - far, near + LEAST) * extent
