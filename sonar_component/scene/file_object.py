"""One object as a mesh file has it, before it is made sound."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonar_component.scene.material import Material
from sonar_component.scene.surface import Surface


@dataclass
class FileObject:
    """Triangles, where the file's scene graph puts them, and their material.

    Attributes
    ----------
    name : as the file calls it.
    X_FO : (4, 4) affine, may scale and mirror.
    surface : shared between instances; the same object for the same triangles.
    material : by the file's name for it.
    """

    name: str
    X_FO: NDArray[np.float64]
    surface: Surface
    material: Material
