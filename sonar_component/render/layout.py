"""Where the samples of a fan lie: narrow perspective views side by side, and what each of their cells is worth.

One perspective image cannot cover the sector of a sonar: its lower edge rises towards the sides and its columns do not
line up with the beams. A few views of at most 45 deg can, each turned about the sonar's Z axis so that a column has
one bearing. Every cell carries its exact solid angle inside the aperture; cells across its edge carry their share.

A view may be drawn in interleaved phases: phase k of P takes every P-th column with its rows shifted by a fraction of a
cell. Horizontal edges then fall on more elevations per beam, which halves the error of P = 1 at the same sample count.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MAX_VIEW = np.radians(45.0)  # [rad]; wider views spend more cells above the aperture and at their sides
_PHASE_SHIFTS = {1: (0.0,), 2: (0.0, 0.5), 4: (0.0, 0.5, 0.25, 0.75)}  # [cells], van der Corput


@dataclass(frozen=True)
class Block:
    """One rectangle of the target: a phase of a view.

    Coordinates x (right positive) and y (up) are tangents in the view's plane at depth 1.

    Attributes
    ----------
    azimuth : float
        Direction of the view's axis [rad], left positive.
    half_width : float
        Half of the view's azimuth [rad].
    first_column, columns : int
        Place in the target.
    x_left, x_step, y_bottom, y_step : float
        Left edge, column pitch, lower edge, row pitch [tangent].
    """

    azimuth: float
    half_width: float
    first_column: int
    columns: int
    x_left: float
    x_step: float
    y_bottom: float
    y_step: float


@dataclass(frozen=True)
class Layout:
    """All samples of a fan.

    Attributes
    ----------
    blocks : tuple of Block
    rows, columns : int
        Size of the target; columns beyond the last block are padding.
    phases : int
    right, left : (columns,) float64
        Azimuth edges of each column's cells [rad].
    solid_angle : (rows, columns) float32
        Part of each cell that lies inside the aperture [sr].
    first_row, last_row : (columns,) int32
        Rows whose cells touch the aperture.
    first_clip, last_clip : (columns,) float32
        Part of the first row's cell below the aperture, of the last row's cell above it [-], in 0..1.
    half_height : float
        [rad].
    """

    blocks: tuple[Block, ...]
    rows: int
    columns: int
    phases: int
    right: Array
    left: Array
    solid_angle: NDArray[np.float32]
    first_row: NDArray[np.int32]
    last_row: NDArray[np.int32]
    first_clip: NDArray[np.float32]
    last_clip: NDArray[np.float32]
    half_height: float

    def elevations(self) -> Array:
        """(rows, columns) float64: elevation of the centre of each cell [rad], for truth images."""
        row = np.arange(self.rows)[:, None] + 0.5
        parts = []
        for block in self.blocks:
            x = _column_centres(block)
            parts.append(np.arctan((block.y_bottom + row * block.y_step) / np.sqrt(1 + x * x)[None, :]))
        out = np.full((self.rows, self.columns), np.nan)
        out[:, : sum(part.shape[1] for part in parts)] = np.concatenate(parts, axis=1)
        return out


def _column_centres(block: Block) -> Array:
    return block.x_left + (np.arange(block.columns, dtype=np.float64) + 0.5) * block.x_step


def build_layout(
    right: float, left: float, half_height: float, column_width: float, rows: int, phases: int = 1
) -> Layout:
    """Lay the samples of the sector from azimuth ``right`` to ``left``.

    Parameters
    ----------
    right, left : float
        Edges of the sector [rad], ``right < left <= right + 2 pi``.
    half_height : float
        Half of the elevation aperture [rad], below 90 deg.
    column_width : float
        Greatest width of a cell in azimuth [rad].
    rows : int
        Cells over the elevation aperture at a view's axis.
    phases : {1, 2, 4}
        Interleaved draws per view.
    """
    views = max(1, int(np.ceil((left - right) / MAX_VIEW - 1e-9)))
    half = (left - right) / views / 2
    per_phase = max(1, int(np.ceil(2 * np.tan(half) / column_width / phases - 1e-9)))
    x_cell = 2 * np.tan(half) / (per_phase * phases)
    y_step = 2 * np.tan(half_height) / rows
    y_top = np.tan(half_height) / np.cos(half)
    total_rows = int(np.ceil(2 * y_top / y_step - 1e-9)) + (phases > 1)
    blocks: list[Block] = []
    for view in range(views):
        azimuth = left - half * (2 * view + 1)
        for phase, shift in enumerate(_PHASE_SHIFTS[phases]):
            x_left = -np.tan(half) + (phase + 0.5 - phases / 2) * x_cell
            y_bottom = -y_step * (total_rows / 2 + (shift - 0.5) * (phases > 1))
            first = len(blocks) * per_phase
            blocks.append(Block(azimuth, half, first, per_phase, x_left, phases * x_cell, y_bottom, y_step))
    return _tables(tuple(blocks), total_rows, phases, half_height, x_cell)


def _tables(blocks: tuple[Block, ...], rows: int, phases: int, half_height: float, x_cell: float) -> Layout:
    used = sum(block.columns for block in blocks)
    columns = _pitch(used)
    right, left = np.full(columns, np.nan), np.full(columns, np.nan)
    solid_angle = np.zeros((rows, columns), np.float32)
    first_row, last_row = np.zeros(columns, np.int32), np.full(columns, -1, np.int32)
    first_clip, last_clip = np.zeros(columns, np.float32), np.zeros(columns, np.float32)
    for block in blocks:
        where = slice(block.first_column, block.first_column + block.columns)
        x = _column_centres(block)
        left[where] = block.azimuth - np.arctan(x - x_cell / 2)
        right[where] = block.azimuth - np.arctan(x + x_cell / 2)
        y_edge = np.tan(half_height) * np.sqrt(1 + x * x)  # tangent of the aperture's edge in each column
        below = (-y_edge - block.y_bottom) / block.y_step
        above = (y_edge - block.y_bottom) / block.y_step
        first_row[where] = np.clip(np.floor(below + 1e-9), 0, rows - 1)
        last_row[where] = np.clip(np.ceil(above - 1e-9) - 1, 0, rows - 1)
        first_clip[where] = np.clip(below - first_row[where], 0, 1)
        last_clip[where] = np.clip(last_row[where] + 1 - above, 0, 1)
        y = block.y_bottom + np.arange(rows + 1)[:, None] * block.y_step
        elevation = np.clip(np.arctan(y / np.sqrt(1 + x * x)), -half_height, half_height)
        solid_angle[:, where] = np.diff(np.sin(elevation), axis=0) * (left[where] - right[where])
    return Layout(
        blocks, rows, columns, phases, right, left, solid_angle, first_row, last_row, first_clip, last_clip, half_height
    )


def _pitch(columns: int) -> int:
    """Columns with padding: an odd number of 64-byte lines, so that a walk up the rows does not hit one cache set."""
    lines = -(-columns // 8)
    return 8 * (lines + (lines % 2 == 0))
