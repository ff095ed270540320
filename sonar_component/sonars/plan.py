"""How many samples a fan needs for the accuracy that was asked for: measured on the scene itself, not guessed.

The error of an image depends on what is in it: a flat floor is exact at once, a wreck with ribs and shadow edges needs
more. So the planner renders the scene on two neighbouring levels of a ladder and takes their difference as the error of
the coarser one, going up or down until the cheapest level that meets the target is found. It looks when settings or
geometry change and now and then while running. A formula of beams, bins and aperture alone lost: between the standard
scenes the same samples differ five times in error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonar_component.echo.beams import BeamTable

# Columns per beam and rows per 20 deg of aperture; each level has about twice the samples of the one before.
LADDER = ((1, 24), (2, 32), (3, 48), (4, 64), (6, 96), (8, 128), (12, 192), (16, 256), (24, 384))
START = 3  # [level]
_COARSER = 1.2  # [-], error of a level relative to its difference from the next: 1.05 to 1.3 on scenes with a reference
_SLACK = 0.5  # [-], of the target: going down a level must leave this much room, or the choice would flicker
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


def choose_level(
    energy_image: Callable[[int], NDArray[np.float32]], accuracy: float, highest: int, start: int = START
) -> tuple[int, float]:
    """The coarsest level that meets a target, and its estimated energy error [-]; NaN where there is but one level.

    Parameters
    ----------
    energy_image : function of a level -> (beams, bins) float32
    accuracy : float
        Target [-].
    highest : int
        Level to stop at, met or not.
    start : int
        Level to begin with.
    """
    images: dict[int, NDArray[np.float32]] = {}

    def estimate(level: int) -> float:
        for wanted in (level, level + 1):
            if wanted not in images:
                images[wanted] = energy_image(wanted)
        finer = float(np.linalg.norm(images[level + 1]))
        return _COARSER * float(np.linalg.norm(images[level + 1] - images[level])) / finer if finer > 0 else 0.0

    if highest == 0:
        return 0, float("nan")
    level = min(start, highest - 1)
    error = estimate(level)
    if error <= accuracy:
        while level > 0:
            lower = estimate(level - 1)
            if lower > _SLACK * accuracy:
                break
            level, error = level - 1, lower
        return level, error
    while error > accuracy and level < highest - 1:
        level += 1
        error = estimate(level)
    if error > accuracy:
        # The finest level has no finer neighbour: half of the difference is what the ladder promises.
        return highest, error / 2
    return level, error
