"""How many samples a fan needs for the accuracy that was asked for: measured on the scene itself, not guessed.

The error of an image depends on what is in it: a flat floor is exact at once, a wreck with ribs and shadow edges needs
more. So the planner renders the scene on two levels of a ladder and takes their difference as the error of the coarser
one, going up or down until the cheapest level that meets the target is found. It looks when settings or geometry
change, and now and then while something moves. A formula of beams, bins and aperture alone lost: between the standard
scenes the same samples differ five times in error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonar_component.echo.beams import BeamTable

# Columns per beam and rows per 20 deg of aperture; each level has about 1.4 times the samples of the one before.
LADDER = (
    (1, 16), (1, 22), (2, 27), (2, 33), (2, 40), (3, 44), (3, 50), (4, 56), (4, 64), (5, 80), (6, 96), (7, 112),
    (8, 128), (10, 160), (12, 192), (14, 224), (16, 256), (20, 320), (24, 384),
)  # fmt: skip
START = 7  # [level]
_FINER = 3  # [levels], of the image that a level is compared with: neighbours share too much of their error
_COARSER = 1.15  # [-], error of a level relative to that difference: 1.0 to 1.2 on scenes with a reference
_GAIN = 0.7  # [-], least part of the error that the next level leaves
_USUAL, _USUAL_GAIN = 0.2, 0.77  # [-], error of level 0 on scenes with a reference, and what each level leaves of it
_BELOW = 4  # [levels] that an easy scene may stay below usual ones: something small may come into view any time
_WORSE = 0.85  # [-], error of a level relative to that of the next lower one: at most, where looking is worth it
_SLACK = 0.8  # [-], of the target: leaving a level that is in use for a lower one needs this much room
_WIDEST = np.radians(2.0)  # [rad], of a column with one column per beam: keeps footprints local in wide beams
_MOST_SAMPLES = 4_000_000  # [-], 32 MB of target
_MOST_COLUMNS = 15_000  # [-], of the 16384 that every OpenGL 4.3 has: flat views need up to 6 % more than angles say


@dataclass(frozen=True)
class Plan:
    """Samples of a fan.

    Attributes
    ----------
    level : int
        On the ladder.
    column_width : float
        Greatest width of a cell in azimuth [rad].
    rows : int
        Cells over the elevation aperture.
    shear : float
        From column to column [cells]: see render/layout.py.
    """

    level: int
    column_width: float
    rows: int
    shear: float


def plan_at(beams: BeamTable, level: int) -> Plan:
    """The plan of a level for these beams."""
    per_beam, rows = LADDER[level]
    width = float(np.min(beams.left - beams.right))
    column_width = max(min(width, _WIDEST) / per_beam, beams.width / _MOST_COLUMNS)
    tall = np.clip(2 * np.degrees(beams.half_height) / 20.0, 0.25, 8.0)
    columns = max(2, min(8, round(width / column_width)))
    return Plan(level, float(column_width), max(4, round(rows * float(tall))), 1.0 / columns)


def highest_level(beams: BeamTable) -> int:
    """The finest level whose target stays within reason."""
    level = len(LADDER) - 1
    while level and beams.width / plan_at(beams, level).column_width * plan_at(beams, level).rows > _MOST_SAMPLES:
        level -= 1
    return level


def lowest_level(accuracy: float) -> int:
    """The coarsest level for an accuracy [-], however little is in sight."""
    usual = np.log(min(accuracy, _USUAL) / _USUAL) / np.log(_USUAL_GAIN)
    return int(np.clip(usual - _BELOW, 0, len(LADDER) - 1))


def choose_level(
    energy_image: Callable[[int], NDArray[np.float32]], accuracy: float, highest: int, in_use: int | None = None
) -> tuple[int, float]:
    """The coarsest level that meets a target, and its estimated energy error [-]; NaN where there is but one level.

    It is never lower than ``lowest_level``.

    Parameters
    ----------
    energy_image : function of a level -> (beams, bins) float32
    accuracy : float
        Target [-].
    highest : int
        Level to stop at, met or not.
    in_use : int, optional
        Level of the images before: kept while it meets the target and the one below does not by far.
    """
    if highest == 0:
        return 0, float("nan")
    images: dict[int, NDArray[np.float32]] = {}

    def image(level: int) -> NDArray[np.float32]:
        if level not in images:
            images[level] = energy_image(level)
        return images[level]

    def estimate(level: int) -> float:
        if level == highest:  # it has no finer one to be compared with: what the ladder promises
            coarser = max(level - _FINER, 0)
            return estimate(coarser) * float(_USUAL_GAIN ** (level - coarser))
        finer = image(min(level + _FINER, highest))
        norm = float(np.linalg.norm(finer))
        return _COARSER * float(np.linalg.norm(finer - image(level))) / norm if norm > 0 else 0.0

    lowest = min(lowest_level(accuracy), highest)
    level = min(max(START if in_use is None else in_use, lowest), highest)
    error = estimate(level)
    if error > accuracy:
        while error > accuracy and level < highest:
            # Never so far that a level between might have been enough.
            level = min(level + max(1, int(np.log(accuracy / error) / np.log(_GAIN))), highest)
            error = estimate(level)
        return level, error
    room = accuracy if in_use is None else _SLACK * accuracy
    while level > lowest and error <= _WORSE * room:
        lower = estimate(level - 1)
        if lower > room:
            break
        level, error = level - 1, lower
    return level, error
