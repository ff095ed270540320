"""How strongly, and with which fine relief, a surface answers a ping."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Material:
    """What the shader knows of a surface besides its shape.

    Attributes
    ----------
    name : as the file or the user calls it.
    reflectance : R > 0 [-], multiplies the echo strength; 1 is the reference.
    normal_map : (h, w, 3) uint8 tangent-space normals, 128 is zero, +Y up, first row on top, or None.
    reflectance_map : (h, w) uint8, 255 keeps `reflectance`, 0 mutes it, first row on top, or None.
    """

    name: str
    reflectance: float = 1.0
    normal_map: NDArray[np.uint8] | None = None
    reflectance_map: NDArray[np.uint8] | None = None

    def __post_init__(self) -> None:
        if not (np.isfinite(self.reflectance) and self.reflectance > 0):
            raise ValueError(f"material '{self.name}': reflectance must be greater than 0, got {self.reflectance}")
