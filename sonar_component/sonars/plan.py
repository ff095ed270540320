"""How many samples a fan needs for the accuracy that was asked for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonar_component.echo.beams import BeamTable


@dataclass(frozen=True)
class Plan:
    """Samples of a fan.

    Attributes
    ----------
    column_width : float
        Greatest width of a cell in azimuth [rad].
    rows : int
        Cells over the elevation aperture.
    shear : float
        From column to column [cells]: see render/layout.py.
    reasons : tuple of str
        Why, in words.
    """

    column_width: float
    rows: int
    shear: float
    reasons: tuple[str, ...]


def make_plan(beams: BeamTable, accuracy: float) -> Plan:
    """Choose the samples for a target energy error [-]."""
    finer = (0.02 / accuracy) ** 0.62  # the error falls with the samples to the power 0.8, rows and columns alike
    width = float(np.min(beams.left - beams.right))
    column_width = min(width / np.ceil(4 * finer), np.radians(0.5) / finer)
    rows = int(max(64 * finer, 2 * np.degrees(beams.half_height) / 0.35 * finer, 8))
    reasons = (
        f"columns of {np.degrees(column_width):.3g} deg: {width / column_width:.3g} for the narrowest beam",
        f"{rows} rows over {2 * np.degrees(beams.half_height):.3g} deg",
    )
    return Plan(float(column_width), rows, 1.0 / min(8, max(2, round(width / column_width))), reasons)
