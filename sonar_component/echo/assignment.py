"""Which columns of samples each beam hears, and how much of each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonar_component.echo.beams import BeamTable

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Assignment:
    """Columns of each beam, all beams in one list.

    Attributes
    ----------
    start : (beams + 1,) int64
        Beam b owns the entries ``start[b]:start[b + 1]``.
    column : (entries,) int32
        Column of the target.
    share : (entries,) float32
        Part of the column's width that lies in the beam's sector [-].
    """

    start: NDArray[np.int64]
    column: NDArray[np.int32]
    share: NDArray[np.float32]


def assign(beams: BeamTable, right: Array, left: Array) -> Assignment:
    """Share the columns among the beams by the overlap of their azimuths.

    Parameters
    ----------
    right, left : (columns,) float64
        Azimuth edges of each column's cells [rad]; NaN for padding.
    """
    used = np.flatnonzero(np.isfinite(left))
    order = used[np.argsort(-left[used], kind="stable")]
    # Beams and columns both run from left to right: a beam's columns are then one run of the sorted ones.
    first = np.searchsorted(-right[order], -beams.left, side="right")
    last = np.searchsorted(-left[order], -beams.right, side="left")
    counts = np.maximum(last - first, 0)
    start = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    beam = np.repeat(np.arange(len(counts)), counts)
    column = order[np.arange(start[-1]) - start[beam] + first[beam]]
    overlap = np.minimum(beams.left[beam], left[column]) - np.maximum(beams.right[beam], right[column])
    share = np.clip(overlap / (left[column] - right[column]), 0.0, 1.0)
    return Assignment(start, column.astype(np.int32), share.astype(np.float32))
