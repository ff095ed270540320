"""What to draw of a world: the tiles that each view of a fan may see, and the instances that say where they are.

Compiled by numba, which is there for echo/binning.py: a hundred objects in 7 views took NumPy 0.26 ms a frame, without
the order and the back faces; this takes 0.09 with them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from sonar_component.render.packing import COMMAND, Packed

Array = NDArray[np.float64]

# [-], distance of a shell relative to that of the near plane's corner: cut open, it would show its inside. The corner
# of an aperture of 150 deg is four near planes away.
_CLEAR = 1.1


@dataclass(frozen=True)
class Sight:
    """What the views of a fan can see.

    Attributes
    ----------
    azimuths : (views,) float64
        Directions of the views' axes [rad].
    half_width : float
        Of every view [rad].
    tangent_up : float
        Tangent of their upper (and lower) edge at depth 1.
    near, range_max : float
        Between which something is drawn [m].
    """

    azimuths: Array
    half_width: float
    tangent_up: float
    near: float
    range_max: float


@dataclass(frozen=True)
class Draws:
    """Tiles to draw, near ones first, in four groups: with pictures and without, of those closed and open ones.

    Attributes
    ----------
    tiles, views : (n,) int32
    counts : (4,) int
        Of each group: pictured closed, pictured open, plain closed, plain open. Closed shells are seen from outside,
        so that their back faces need not be drawn.
    """

    tiles: NDArray[np.int32]
    views: NDArray[np.int32]
    counts: NDArray[np.int64]


def everything(packed: Packed) -> Draws:
    """All tiles in one view, as open ones."""
    count = len(packed.commands)
    numbers = np.arange(count, dtype=np.int32)
    return Draws(numbers, np.zeros(count, np.int32), np.array([0, 0, 0, count]))


def choose(packed: Packed, X_SM: Array, sight: Sight) -> Draws:
    """The tiles that may touch a view: within range, between its four planes, not behind it, not facing away.

    Parameters
    ----------
    X_SM : (parts, 4, 4) float64
        Poses of the parts in the sonar's frame [m].
    """
    up, corner = np.arctan(sight.tangent_up), np.sqrt(1 + np.tan(sight.half_width) ** 2 + sight.tangent_up**2)
    most = len(packed.commands) * len(sight.azimuths)
    tiles, views, counts = np.empty(most, np.int32), np.empty(most, np.int32), np.zeros(4, np.int64)
    _choose(
        X_SM, packed.tile_part, packed.tile_centre, packed.tile_radius, packed.tile_hull, packed.tile_axis,
        packed.tile_spread, packed.pictured, np.cos(sight.azimuths), np.sin(sight.azimuths),
        np.sin(sight.half_width), np.cos(sight.half_width), np.sin(up), np.cos(up),
        _CLEAR * corner * sight.near, sight.range_max, tiles, views, counts,
    )  # fmt: skip
    count = int(counts.sum())
    return Draws(tiles[:count], views[:count], counts)


def fill(
    packed: Packed, draws: Draws, X_SM: Array, X_DS: Array, bands: NDArray[np.float32], instances: NDArray[np.void]
) -> NDArray[np.void]:
    """Write instances of draws, and return their indirect commands.

    Parameters
    ----------
    X_SM : (parts, 4, 4) float64
        Poses of the parts in the sonar's frame [m].
    X_DS : (views, 4, 4) float64
        Sonar frame to clip space of each view.
    bands : (views, 2) float32
        First column and number of columns of each view; (views, 0) where instances have none.
    instances : (n or more,) of ``packing.instance_type``, perhaps with bands
    """
    commands = np.empty(len(draws.tiles), COMMAND)
    words = instances.view(np.uint32).reshape(len(instances), -1)
    templates = packed.instances.view(np.uint32).reshape(len(packed.instances), -1)
    _fill(
        draws.tiles, draws.views, packed.tile_part, X_SM, X_DS, bands, templates,
        packed.commands.view(np.uint32).reshape(-1, 5), words, words.view(np.float32),
        commands.view(np.uint32).reshape(-1, 5),
    )  # fmt: skip
    return commands


@numba.njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _choose(
    X_SM: Any,
    tile_part: Any,
    centre: Any,
    radius: Any,
    hull: Any,
    axis: Any,
    spread: Any,
    pictured: Any,
    view_cos: Any,
    view_sin: Any,
    side_sin: float,
    side_cos: float,
    up_sin: float,
    up_cos: float,
    clear: float,
    range_max: float,
    tiles: Any,
    views: Any,
    counts: Any,
) -> None:
    # Those within range and above and below, near ones first: what they hide costs less then.
    near = np.empty(len(tile_part), np.int32)
    place_S = np.empty((len(tile_part), 3))
    front = np.empty(len(tile_part))
    kept = 0
    for tile in range(len(tile_part)):
        X, c, r = X_SM[tile_part[tile]], centre[tile], radius[tile]
        x = X[0, 0] * c[0] + X[0, 1] * c[1] + X[0, 2] * c[2] + X[0, 3]
        y = X[1, 0] * c[0] + X[1, 1] * c[1] + X[1, 2] * c[2] + X[1, 3]
        z = X[2, 0] * c[0] + X[2, 1] * c[1] + X[2, 2] * c[2] + X[2, 3]
        distance = np.sqrt(x * x + y * y + z * z)
        if distance >= range_max + r or abs(z) * up_cos - np.sqrt(x * x + y * y) * up_sin >= r:
            continue
        near[kept] = tile
        place_S[kept, 0], place_S[kept, 1], place_S[kept, 2] = x, y, z
        front[kept] = distance - r
        kept += 1
    found = 0
    seen_tile, seen_view = np.empty_like(tiles), np.empty_like(views)
    group = np.empty(len(tiles), np.uint8)
    sonar = np.empty(3)
    for k in np.argsort(front[:kept]):
        tile = near[k]
        X, r = X_SM[tile_part[tile]], radius[tile]
        x, y, z = place_S[k]
        distance = front[k] + r
        outside = False
        if hull[tile, 0, 0] <= hull[tile, 1, 0]:  # NaN where the tile is open
            for i in range(3):
                sonar[i] = -(X[0, i] * X[0, 3] + X[1, i] * X[1, 3] + X[2, i] * X[2, 3])
                if sonar[i] < hull[tile, 0, i] - clear or sonar[i] > hull[tile, 1, i] + clear:
                    outside = True
        if outside and distance > r:
            # All normals lie within `spread` of the axis, all lines of sight within asin(r / distance) of the centre's:
            # if they add up to less than a right angle, every face is seen from behind.
            widest = spread[tile] + np.arcsin(r / distance)
            if widest < 0.5 * np.pi:
                a = axis[tile]
                along = (
                    a[0] * (X[0, 0] * x + X[1, 0] * y + X[2, 0] * z)
                    + a[1] * (X[0, 1] * x + X[1, 1] * y + X[2, 1] * z)
                    + a[2] * (X[0, 2] * x + X[1, 2] * y + X[2, 2] * z)
                )
                if along > np.sin(widest) * distance:
                    continue
        for view in range(len(view_cos)):
            depth = view_cos[view] * x + view_sin[view] * y
            side = abs(view_cos[view] * y - view_sin[view] * x)
            if depth > -r and depth * side_sin - side * side_cos > -r and depth * up_sin - abs(z) * up_cos > -r:
                seen_tile[found], seen_view[found] = tile, view
                group[found] = (0 if pictured[tile] else 2) + (0 if outside else 1)
                counts[group[found]] += 1
                found += 1
    place = np.zeros(4, np.int64)
    for k in range(1, 4):
        place[k] = place[k - 1] + counts[k - 1]
    for k in range(found):
        g = group[k]
        tiles[place[g]], views[place[g]] = seen_tile[k], seen_view[k]
        place[g] += 1


@numba.njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _fill(
    tiles: Any,
    views: Any,
    tile_part: Any,
    X_SM: Any,
    X_DS: Any,
    bands: Any,
    templates: Any,
    commands: Any,
    words: Any,
    numbers: Any,
    commands_out: Any,
) -> None:
    fixed, whole = templates.shape[1], words.shape[1]
    for k in range(len(tiles)):
        tile, view = tiles[k], views[k]
        X, P = X_SM[tile_part[tile]], X_DS[view]
        for row in range(3):
            for column in range(4):
                numbers[k, 4 * row + column] = X[row, column]
        for row in range(4):
            for column in range(4):
                total = P[row, 0] * X[0, column] + P[row, 1] * X[1, column] + P[row, 2] * X[2, column]
                numbers[k, 12 + 4 * row + column] = total + (P[row, 3] if column == 3 else 0.0)
        for column in range(28, fixed):
            words[k, column] = templates[tile, column]
        for column in range(fixed, whole):
            numbers[k, column] = bands[view, column - fixed]
        for column in range(4):
            commands_out[k, column] = commands[tile, column]
        commands_out[k, 4] = k
