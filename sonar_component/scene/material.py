"""How strongly, and with which fine relief, a surface answers a ping."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MOST_REFLECTANCE = 1e6  # [-], 120 dB of energy: keeps the sums of any image far from float32's end


@dataclass(frozen=True, eq=False)
class Material:
    """What the shader knows of a surface besides its shape.

    Attributes
    ----------
    name : as the file or the user calls it.
    reflectance : 0 < R <= MOST_REFLECTANCE [-], multiplies the echo strength; 1 is the reference.
    normal_map : (h, w, 3) uint8 tangent-space normals, 128 is zero, +Y up, first row on top, or None.
    reflectance_map : (h, w) uint8, 255 keeps `reflectance`, 0 mutes it, first row on top, or None.
    """

    name: str
    reflectance: float = 1.0
    normal_map: NDArray[np.uint8] | None = None
    reflectance_map: NDArray[np.uint8] | None = None

    def __post_init__(self) -> None:
        if not 0 < self.reflectance <= MOST_REFLECTANCE:
            allowed = f"greater than 0 and at most {MOST_REFLECTANCE:g}"
            raise ValueError(f"material '{self.name}': reflectance must be {allowed}, got {self.reflectance}")
