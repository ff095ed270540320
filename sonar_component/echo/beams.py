"""Bearing tables: where each beam of a fan looks and which sector it hears."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BeamTable:
    """Beams from left to right.

    Attributes
    ----------
    bearings : (beams,) float64
        Centres [rad], left positive.
    right, left : (beams,) float64
        Edges of each beam's sector [rad], ``right < left``.
    half_height : float
        Half of the elevation aperture [rad]: a beam hears ``|elevation| < half_height``.
    """

    bearings: Array
    right: Array
    left: Array
    half_height: float

    @property
    def solid_angle(self) -> Array:
        """(beams,) float64: solid angle of each beam's sector [sr]."""
        return np.asarray((self.left - self.right) * 2.0 * np.sin(self.half_height))

    @property
    def width(self) -> float:
        """Opening of the whole fan [rad]."""
        return float(self.left.max() - self.right.min())

    def turned(self, bearing: float) -> BeamTable:
        """The same beams about another bearing [rad]."""
        return BeamTable(self.bearings + bearing, self.right + bearing, self.left + bearing, self.half_height)


def equal_angle(beam_count: int, beam_width: float, beam_height: float) -> BeamTable:
    """Beams of equal width that tile the fan.

    Parameters
    ----------
    beam_width, beam_height : float
        Opening of the whole fan [rad].
    """
    edges = np.linspace(beam_width / 2, -beam_width / 2, beam_count + 1)
    return BeamTable((edges[:-1] + edges[1:]) / 2, edges[1:], edges[:-1], beam_height / 2)


def equal_sine(beam_count: int, beam_width: float, beam_height: float) -> BeamTable:
    """Beams whose edges and centres are equally spaced in the sine of the bearing, as line arrays form them.

    Raises
    ------
    ValueError
        If the fan is wider than 180 deg: a sine does not tell front from back.
    """
    if beam_width > np.pi + 1e-9:
        got = f"{np.degrees(beam_width):.6g} deg"
        raise ValueError(f"bearings equal in sine need a beam_width of at most 180 deg, got {got}")
    half = min(beam_width / 2, np.pi / 2)
    sines = np.linspace(np.sin(half), -np.sin(half), 2 * beam_count + 1)
    angles = np.arcsin(sines)
    return BeamTable(angles[1::2], angles[2::2], angles[:-1:2], beam_height / 2)


def from_list(bearings: Array, beam_height: float) -> BeamTable:
    """Beams of a device's own table: edges midway between centres, the outermost symmetric about theirs.

    Parameters
    ----------
    bearings : (beams,) float64
        Centres [rad], left positive, strictly rising or falling.

    Raises
    ------
    ValueError
        If a centre repeats or turns back, if there is only one, or if the fan exceeds a full turn.
    """
    centres = np.asarray(bearings, np.float64)
    steps = np.diff(centres)
    if centres.size < 2 or not np.isfinite(centres).all():
        raise ValueError(f"bearings must be a list of at least 2 finite angles, got {centres.size}")
    if not ((steps > 0).all() or (steps < 0).all()):
        raise ValueError("bearings must rise or fall from beam to beam without a repeat")
    inner = (centres[:-1] + centres[1:]) / 2
    edges = np.concatenate([[2 * centres[0] - inner[0]], inner, [2 * centres[-1] - inner[-1]]])
    if abs(edges[-1] - edges[0]) > 2 * np.pi + 1e-9:
        raise ValueError("bearings must span at most 360 deg")
    return BeamTable(centres, np.minimum(edges[:-1], edges[1:]), np.maximum(edges[:-1], edges[1:]), beam_height / 2)
