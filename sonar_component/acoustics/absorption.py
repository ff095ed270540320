"""Absorption of sound in sea water."""

from __future__ import annotations

import math


def absorption(frequency: float, temperature: float, salinity: float, acidity: float, depth: float) -> float:
    """Absorption coefficient after Ainslie and McColm.

    Parameters
    ----------
    frequency : float
        [Hz], valid from 100 Hz to 1 MHz.
    temperature : float
        [K], valid from -6 to 35 degC.
    salinity : float
        [ppt], valid from 5 to 50, and used down to 0 as the original simulator does.
    acidity : float
        pH [-], valid from 7.7 to 8.3.
    depth : float
        [m], valid from 0 to 7000.

    Returns
    -------
    float
        [dB/km], one way.

    Notes
    -----
    M. A. Ainslie and J. G. McColm, J. Acoust. Soc. Am. 103 (1998) 1671, the simplified formula with its three terms:
    boric acid, magnesium sulphate, water. Figures for 700 kHz (20 degC, 35 ppt, pH 8.1, 1 m): 214.6 dB/km.
    """
    f, T = frequency / 1e3, temperature - 273.15
    f_boron = 0.78 * math.sqrt(salinity / 35) * math.exp(T / 26)
    f_magnesium = 42 * math.exp(T / 17)
    boron = 0.106 * f_boron * f**2 / (f**2 + f_boron**2) * math.exp((acidity - 8) / 0.56)
    magnesium = 0.52 * (1 + T / 43) * (salinity / 35) * f_magnesium * f**2 / (f**2 + f_magnesium**2)
    water = 0.00049 * f**2 * math.exp(-(T / 27 + depth / 17e3))
    return boron + magnesium * math.exp(-depth / 6e3) + water


def nepers_per_metre(decibels_per_kilometre: float) -> float:
    """The same for the amplitude [Np/m], as an exponent needs it."""
    return decibels_per_kilometre / 1e3 * math.log(10) / 20
