"""Triangles of one surface, near their own origin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles in their own frame M; never changed once made, so a renderer may key its buffers by identity.

    Attributes
    ----------
    vertices : (n, 3) float64 [m] in M, finite, close to M's origin.
    normals : (n, 3) float32, unit, outward where the file says so.
    faces : (m, 3) int32, no two corners of a face alike.
    uv : (n, 2) float32 texture coordinates, (0, 0) at the lower left, or None.
    """

    vertices: NDArray[np.float64]
    normals: NDArray[np.float32]
    faces: NDArray[np.int32]
    uv: NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        for array in (self.vertices, self.normals, self.faces, self.uv):
            if array is not None:
                array.setflags(write=False)

    @property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) float64, least and greatest corner in M [m]."""
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])
