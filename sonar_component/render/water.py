"""What water does to light; apart from the camera, so that its numbers can be had without OpenGL."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Water:
    """Optical properties of the water.

    Attributes
    ----------
    absorption : (3,) floats
        Of red, green and blue light [1/m]. Default: pure water at 650, 525 and 450 nm (Pope and Fry, Appl. Opt. 36,
        1997, table 3).
    scattering : float
        By particles, the same for all colours [1/m]; 0.04 is clear coastal water.
    surface : float
        Height of the water's surface in the world [m].
    """

    absorption: tuple[float, float, float] = (0.340, 0.0417, 0.00922)
    scattering: float = 0.04
    surface: float = 0.0
