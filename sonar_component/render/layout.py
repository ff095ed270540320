"""Where the samples of a fan lie: narrow perspective views, and what each of their cells is worth.

One perspective image cannot cover the sector of a sonar: its lower edge rises towards the sides and its columns do not
line up with the beams. A few views of at most 45 deg can, each turned about the sonar's Z axis so that a column has
one bearing. Every cell carries its exact solid angle inside the aperture; cells across its edge carry their share.

Views are drawn lying on their side: a column of samples, one bearing, is a line of the target, so that whoever bins a
beam walks through memory in order. They are also drawn sheared: each column's cells lie a fraction of a cell lower than
its neighbour's. The columns of one beam then cut a horizontal edge (a crest, a shadow, the top of a box) at different
elevations, as interleaved draws or multisampling would, without a second pass over the triangles. The shear costs rows
at a view's corners, so views are kept narrow.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MAX_VIEW = np.radians(45.0)  # [rad]; wider views spend more cells above the aperture and at their sides
MOST_VIEWS = 48  # [-]
_NARROW, _WIDE = 0.6, 1.3  # [-], rows added by the shear, relative to those over the aperture
_LEAST_COLUMNS = 16  # [-], per view: below that the shear's rows are fewer than what another view costs


@dataclass(frozen=True)
class View:
    """One perspective view: some columns of the target.

    Coordinates x (right positive) and y (up) are tangents in the view's plane at depth 1.

    Attributes
    ----------
    azimuth : float
        Direction of the view's axis [rad], left positive.
    half_width : float
        Half of the view's azimuth [rad].
    first_column, columns : int
        Place in the target.
    rows : int
    x_left, x_step, y_step : float
        Left edge, width of a cell, height of a cell [tangent].
    shear : float
        By how much each column's cells lie below those of its left neighbour [cells].
    """

    azimuth: float
    half_width: float
    first_column: int
    columns: int
    rows: int
    x_left: float
    x_step: float
    y_step: float
    shear: float

    def column_centres(self) -> Array:
        """(columns,) float64: x of the cells [tangent]."""
        return self.x_left + (np.arange(self.columns, dtype=np.float64) + 0.5) * self.x_step

    def column_bottoms(self) -> Array:
        """(columns,) float64: lower edge of the lowest cell of each column [tangent]."""
        tilt = self.shear * (np.arange(self.columns) + 0.5 - self.columns / 2)
        return np.asarray(-self.y_step * (self.rows / 2 + tilt))


@dataclass(frozen=True)
class Layout:
    """All samples of a fan.

    Attributes
    ----------
    views : tuple of View
    columns, rows : int
        Lines of the target (bearings, from left to right), and cells in each (elevations, upwards).
    right, left : (columns,) float64
        Azimuth edges of each column's cells [rad].
    solid_angle : (columns, rows) float32
        Part of each cell that lies inside the aperture [sr].
    first_row, last_row : (columns,) int32
        Rows whose cells touch the aperture.
    first_clip, last_clip : (columns,) float32
        Part of the first row's cell below the aperture, of the last row's cell above it [-], in 0..1.
    half_height : float
        Half of the elevation aperture [rad].
    """

    views: tuple[View, ...]
    columns: int
    rows: int
    right: Array
    left: Array
    solid_angle: NDArray[np.float32]
    first_row: NDArray[np.int32]
    last_row: NDArray[np.int32]
    first_clip: NDArray[np.float32]
    last_clip: NDArray[np.float32]
    half_height: float

    @property
    def azimuths(self) -> Array:
        """(views,) float64: directions of the views' axes [rad]."""
        return np.array([view.azimuth for view in self.views])

    def elevations(self) -> Array:
        """(columns, rows) float64: elevation of the centre of each cell [rad], for truth images."""
        row = np.arange(self.rows)[None, :] + 0.5
        parts = []
        for view in self.views:
            x = view.column_centres()[:, None]
            parts.append(np.arctan((view.column_bottoms()[:, None] + row * view.y_step) / np.sqrt(1 + x * x)))
        return np.concatenate(parts)


def build_layout(
    right: float,
    left: float,
    half_height: float,
    column_width: float,
    rows: int,
    shear: float = 0.0,
    wide: bool = False,
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
    shear : float
        From column to column [cells], 0 to 1.
    wide : bool
        Few wide views with many rows rather than more narrow ones: a dense mesh is then drawn fewer times.
    """
    widest = MAX_VIEW
    if shear > 0:
        widest = min(widest, column_width * max(_LEAST_COLUMNS, (_WIDE if wide else _NARROW) * rows / shear))
    count = min(MOST_VIEWS, max(1, int(np.ceil((left - right) / widest - 1e-9))))
    half = (left - right) / count / 2
    columns = max(1, int(np.ceil(2 * np.tan(half) / column_width - 1e-9)))
    y_step = 2 * np.tan(half_height) / rows
    total_rows = int(np.ceil(2 * np.tan(half_height) / np.cos(half) / y_step + shear * (columns - 1) - 1e-9))
    shape = (columns, total_rows, -np.tan(half), 2 * np.tan(half) / columns, y_step, shear)
    views = tuple(View(left - half * (2 * k + 1), half, k * columns, *shape) for k in range(count))
    return with_tables(views, total_rows, half_height)


def with_tables(views: tuple[View, ...], rows: int, half_height: float) -> Layout:
    """The layout of these views, each `rows` high, with the exact worth of every cell."""
    right, left, solid_angle, first_row, last_row, first_clip, last_clip = [], [], [], [], [], [], []
    for view in views:
        x = view.column_centres()
        left.append(view.azimuth - np.arctan(x - view.x_step / 2))
        right.append(view.azimuth - np.arctan(x + view.x_step / 2))
        y_edge = np.tan(half_height) * np.sqrt(1 + x * x)  # tangent of the aperture's edge in each column
        bottom = view.column_bottoms()
        below = (-y_edge - bottom) / view.y_step
        above = (y_edge - bottom) / view.y_step
        first_row.append(np.clip(np.floor(below + 1e-9), 0, rows - 1))
        last_row.append(np.clip(np.ceil(above - 1e-9) - 1, 0, rows - 1))
        first_clip.append(np.clip(below - first_row[-1], 0, 1))
        last_clip.append(np.clip(last_row[-1] + 1 - above, 0, 1))
        y = bottom[:, None] + np.arange(rows + 1)[None, :] * view.y_step
        elevation = np.clip(np.arctan(y / np.sqrt(1 + x * x)[:, None]), -half_height, half_height)
        solid_angle.append(np.diff(np.sin(elevation), axis=1) * (left[-1] - right[-1])[:, None])
    return Layout(
        views=views,
        columns=sum(view.columns for view in views),
        rows=rows,
        right=np.concatenate(right),
        left=np.concatenate(left),
        solid_angle=np.concatenate(solid_angle).astype(np.float32),
        first_row=np.concatenate(first_row).astype(np.int32),
        last_row=np.concatenate(last_row).astype(np.int32),
        first_clip=np.concatenate(first_clip).astype(np.float32),
        last_clip=np.concatenate(last_clip).astype(np.float32),
        half_height=half_height,
    )
