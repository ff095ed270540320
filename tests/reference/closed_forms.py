"""What simple surfaces return, by formula or by a fine sum over a formula: no rays, no pixels.

Energies are integrals of (cosine of incidence) dOmega, as a sonar with Lambert's law and reflectance 1 hears them.
"""

from __future__ import annotations

import numpy as np

_FINE = 20_001  # [-], points of sums; the midpoint rule's error goes with its square


def nearest_of_tilted_wall(distance: float, tilt: float, right: np.ndarray, left: np.ndarray) -> np.ndarray:
    """Least range to scenes.tilted_wall in each sector of azimuths, at zero elevation [m]."""
    # In polar form about the sonar: r = d cos(tilt) / cos(azimuth + tilt); nearest where azimuth is -tilt.
    nearest = np.clip(-tilt, right, left)
    return np.asarray(distance * np.cos(tilt) / np.cos(nearest + tilt))


def wall_energy(bearings: np.ndarray, right: np.ndarray, left: np.ndarray, half_height: float) -> np.ndarray:
    """Of a wall across the X axis, relative to the solid angle of each beam: its mean cosine."""
    over_elevation = half_height + np.sin(2 * half_height) / 2
    return np.asarray(over_elevation * (np.sin(left) - np.sin(right)) / ((left - right) * 2 * np.sin(half_height)))


def flat_bottom(height: float, half_height: float, edges: np.ndarray) -> np.ndarray:
    """Energy between ranges `edges` of a level sonar over a floor, relative to the beam.

    At depression e the range is h / sin(e) and the cosine of incidence sin(e) = h / r; dOmega = dphi cos(e) de gives
    dE/dr = dphi h^2 / r^3, whose integral is dphi h^2 / 2 (1 / r1^2 - 1 / r2^2). It begins at h / sin(aperture / 2).
    """
    r = np.maximum(edges, height / np.sin(half_height))
    return np.asarray(height**2 / 2 * (1 / r[:-1] ** 2 - 1 / r[1:] ** 2) / (2 * np.sin(half_height)))


def sphere_profile(radius: float, distance: float, edges: np.ndarray) -> np.ndarray:
    """Energy of a sphere between ranges `edges` [sr]; it has to lie inside one beam."""
    edge = np.arcsin(radius / distance)
    theta = (np.arange(_FINE) + 0.5) / _FINE * edge  # off the line to the centre
    aside = distance * np.sin(theta)
    ranges = distance * np.cos(theta) - np.sqrt(radius**2 - aside**2)
    cosine = np.sqrt(1 - (aside / radius) ** 2)
    return np.histogram(ranges, edges, weights=cosine * 2 * np.pi * np.sin(theta) * edge / _FINE)[0]


def plate_energy(distance: float, width: float, height: float) -> float:
    """Energy of scenes.plate on the X axis [sr]: the cosine is d / r and dOmega = d / r^3 dy dz."""
    y, z = (((np.arange(401) + 0.5) / 401 - 0.5) * size for size in (width, height))
    r2 = distance**2 + y[:, None] ** 2 + z[None, :] ** 2
    return float((distance**2 / r2**2).mean() * width * height)


def sigmoid(strength: np.ndarray | float, slope: float = 18.0, centre: float = 2 / 3) -> np.ndarray:
    """The paper's transfer."""
    return np.asarray(1 / (1 + np.exp(-slope * (np.asarray(strength) - centre))))
