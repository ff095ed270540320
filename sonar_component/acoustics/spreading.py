"""Loss by spreading, and the time-varying gain that a receiver sets against it.

Echo strengths are amplitudes: 20 dB are a factor of ten. An image without either is what a receiver shows whose gain
makes up for all losses, which is the paper's assumption (Cerqueira et al. 2017, section 3.3).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

REFERENCE = 1.0  # [m], where levels are given; nearer than that nothing is lost and nothing is added


def spreading_loss(ranges: Array, law: float) -> Array:
    """Two-way loss of a wave that spreads.

    Parameters
    ----------
    ranges : (n,) float64
        [m]
    law : float
        Decibels per decade of range, there and back: 40 for a small target in open water (spherical), 20 between
        surface and floor of shallow water (cylindrical), 0 for none.

    Returns
    -------
    (n,) float64
        [dB], 0 or more.

    Notes
    -----
    TL = 20 log10(r / 1 m) one way for spherical and 10 log10(r / 1 m) for cylindrical spreading: R. J. Urick,
    Principles of Underwater Sound, 3rd ed. (1983), chapter 5.
    """
    return law * np.log10(np.maximum(ranges, REFERENCE) / REFERENCE)


def time_varying_gain(ranges: Array, law: float, absorption: float, limit: float) -> Array:
    """Gain of a receiver that grows with the time since the ping.

    Parameters
    ----------
    ranges : (n,) float64
        [m]
    law : float
        Decibels per decade of range: what the receiver holds against spreading, there and back.
    absorption : float
        What it holds against absorption [dB/m], one way; twice that is added per metre of range.
    limit : float
        Greatest gain of the amplifier [dB].

    Returns
    -------
    (n,) float64
        [dB], from 0 to `limit`.
    """
    beyond = np.maximum(ranges, REFERENCE)
    return np.minimum(law * np.log10(beyond / REFERENCE) + 2 * absorption * (beyond - REFERENCE), limit)


def amplitude(decibels: Array) -> Array:
    """Factor of the amplitude [-] for a level [dB]."""
    return np.asarray(np.exp(decibels * (math.log(10) / 20)))
