"""How speckle is distributed: a standard normal number to the factor that multiplies an echo.

A law is kept as a polynomial of degree 9 and a power, because a polynomial runs on vector registers and a table does
not: 0.04 ms against 0.12 ms for 256 x 500 factors. Gamma laws need the third power: the cube root of a gamma variable
is nearly normal (E. B. Wilson, M. M. Hilferty, Proc. Natl. Acad. Sci. 17 (1931) 684), so few terms are left to add.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DEGREE = 9  # [-]: the distribution is then off by less than 1e-4 for one look, 1e-5 for two and more
REACH = 4.6  # [standard deviations], normal numbers beyond it are clipped: one in 240 000
LEAST_LOOKS = 1.0  # [-], below it the cube root is no longer near to normal


@dataclass(frozen=True)
class Law:
    """A distribution of factors.

    Attributes
    ----------
    coefficients : (10,) float64
        Of the polynomial in a standard normal number, lowest power first.
    power : 1 or 3
        That its value, cut at 0, is raised to.
    folded : bool
        Whether its absolute value is taken instead of cutting it at 0.
    """

    coefficients: Array
    power: int = 1
    folded: bool = False

    def factors(self, normal: Array) -> Array:
        """Factors for standard normal numbers, any shape; the plain twin of the loop in speckle.py."""
        value = np.polynomial.polynomial.polyval(np.clip(normal, -REACH, REACH), self.coefficients)
        cut = np.abs(value) if self.folded else np.maximum(value, 0.0)
        return np.asarray(cut**self.power)


def normal(mean: float, deviation: float, folded: bool = False) -> Law:
    """N(mean, deviation) cut at 0, or its absolute value."""
    coefficients = np.zeros(DEGREE + 1)
    coefficients[:2] = mean, deviation
    return Law(coefficients, 1, folded)


def gamma(looks: float) -> Law:
    """Intensity of fully developed speckle, averaged over `looks` independent looks: mean 1, contrast looks ** -0.5."""
    return _from_quantiles(looks, 1.0)


def rayleigh(looks: float) -> Law:
    """Amplitude of the same, scaled to mean 1; Rayleigh's law for one look."""
    return _from_quantiles(looks, 0.5)


@lru_cache(maxsize=8)
def _from_quantiles(looks: float, power: float) -> Law:
    """Fit a polynomial to the cube root of a gamma variable's quantiles, raised to `power`, as a function of z."""
    z = REACH * np.cos(np.linspace(np.pi, 0, 601))  # Chebyshev's points: a fit through them does not ring
    values = _gamma_quantiles(looks, z) ** power
    # Mean of gamma(looks, 1 / looks) ** power in closed form.
    values /= math.exp(math.lgamma(looks + power) - math.lgamma(looks)) / looks**power
    weights = np.exp(-(z**2) / 8)
    fit = np.polynomial.Polynomial.fit(z, np.cbrt(values), DEGREE, w=weights).convert()
    return Law(np.pad(fit.coef, (0, DEGREE + 1 - len(fit.coef))), 3)


def _gamma_quantiles(looks: float, z: Array) -> Array:
    """Quantiles of a gamma variable of mean 1 and shape `looks` at the probabilities of z, from its integral."""
    log_x = np.linspace(-30 / math.sqrt(looks), 4, 200_001)  # the density is below 1e-13 of its peak at both ends
    log_density = looks * (log_x - np.exp(log_x)) + looks * math.log(looks) - math.lgamma(looks)
    density = np.exp(log_density)
    parts = (density[1:] + density[:-1]) / 2 * (log_x[1] - log_x[0])
    below = np.concatenate([[0.0], np.cumsum(parts)])
    above = np.concatenate(
        [np.cumsum(parts[::-1])[::-1], [0.0]]
    )  # summed from its own end: 1 - below has no digits left
    tiny = 1e-300
    low = np.interp(np.log(_tail(-z)), np.log(np.maximum(below, tiny)), log_x)
    high = np.interp(-np.log(_tail(z)), -np.log(np.maximum(above, tiny)), log_x)
    return np.asarray(np.exp(np.where(z < 0, low, high)))


def _tail(z: Array) -> Array:
    """Probability that a standard normal number is greater than z."""
    return np.array([math.erfc(value / math.sqrt(2)) / 2 for value in z])
