"""Texture coordinates for surfaces that have none: pictures laid on from the six sides of a box, at a given size.

Each face takes the side that it looks at most; where sides change, vertices are doubled. Mapping in the shader, blended
from three sides, was the alternative: it needs no new vertices, but three look-ups for every sample of every sonar.
"""

from __future__ import annotations

import numpy as np

from sonar_component.scene.mesh import Mesh
from sonar_component.scene.normals import face_normals

# For the sides +X, -X, +Y, -Y, +Z, -Z: axis and sign of u, axis of v. Seen from outside u runs right and v up.
_U_AXIS = np.array([1, 1, 0, 0, 0, 0])
_U_SIGN = np.array([1, -1, -1, 1, 1, -1])
_V_AXIS = np.array([2, 2, 2, 2, 1, 1])


def box_mapped(mesh: Mesh, size: float) -> Mesh:
    """Return the mesh with texture coordinates in its own frame M; the picture repeats every `size` [m]."""
    normals, _ = face_normals(mesh.vertices, mesh.faces)
    axis = np.abs(normals).argmax(axis=1)
    side = 2 * axis + (normals[np.arange(len(normals)), axis] < 0)
    key = mesh.faces.astype(np.int64) * 6 + side[:, None]
    used, faces = np.unique(key, return_inverse=True)
    source, side = used // 6, used % 6
    vertices = mesh.vertices[source]
    row = np.arange(len(vertices))
    uv = np.stack([vertices[row, _U_AXIS[side]] * _U_SIGN[side], vertices[row, _V_AXIS[side]]], 1) / size
    corners = faces.reshape(-1, 3).astype(np.int32)
    return Mesh(vertices, mesh.normals[source], corners, uv.astype(np.float32))
