"""Footprints to bins, one sample and one bin at a time in float64: truth for echo/binning.py and bin.comp."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.reference.texels import unpack

LEAST = 2e-6  # [-], least span of a sample relative to its range, as both implementations state it
PART = 1e-3  # [-], least part of a cell that the edge of the aperture leaves
EMPTY = 1e-6  # [-], of the beam's solid angle, below which a bin counts as empty


def sums(
    pixels: np.ndarray, layout: Any, assignment: Any, beams: int, bins: int, range_max: float, min_range: float = 0.0,
    strength_max: float = 1.0, linear: bool = False,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Solid angle [sr] and solid angle times strength [sr] in each bin, (beams, bins) float64 each."""
    weight, energy = np.zeros((beams, bins)), np.zeros((beams, bins))
    for beam in range(beams):
        for entry in range(assignment.start[beam], assignment.start[beam + 1]):
            column = int(assignment.column[entry])
            for row in range(layout.first_row[column], layout.last_row[column] + 1):
                sample = unpack(pixels[column, row], strength_max)
                if not sample.range > 0:
                    continue
                solid_angle = float(layout.solid_angle[column, row]) * float(assignment.share[entry])
                near, far = _span(sample, layout, column, row, range_max / bins)
                for k in range(max(0, int(1 / near) - 1), min(bins, int(1 / far) + 1)):
                    if k * range_max / bins < min_range * (1 - 1e-9):
                        continue
                    begin, end = min(near, 1 / k if k else np.inf), max(far, 1 / (k + 1))
                    part = solid_angle * max(0.0, begin - end) / (near - far)
                    weight[beam, k] += part
                    # The cosine of incidence on a plane is its distance over the range.
                    middle = range_max / bins / sample.range
                    energy[beam, k] += part * sample.strength * ((begin + end) / 2 / middle if linear else 1.0)
    return weight, energy


def image(weight: np.ndarray, energy: np.ndarray, beam_solid_angle: np.ndarray, mean: bool) -> np.ndarray:
    """The mean of the strength over the surface in a bin, or the energy relative to the beam; 0 in an empty bin."""
    whole = np.broadcast_to(beam_solid_angle[:, None], weight.shape)
    return np.where(weight > EMPTY * whole, energy / np.where(mean, np.maximum(weight, 1e-300), whole), 0.0)


def _span(sample: Any, layout: Any, column: int, row: int, bin_length: float) -> tuple[float, float]:
    """Inverse ranges between which the part of the cell inside the aperture lies, near and far end [1/bin]."""
    inverse = bin_length / sample.range  # linear over a plane
    span = sample.extent / sample.range
    near = inverse * (1 + span / 2)
    span = inverse * max(span, LEAST)
    below = float(layout.first_clip[column]) if row == layout.first_row[column] else 0.0
    above = float(layout.last_clip[column]) if row == layout.last_row[column] else 0.0
    start, end = (above, below) if sample.falling else (below, above)
    return near - start * span, near - max(1 - end, start + PART) * span
