"""A whole world as flat arrays: a sonar in another process, or on a host without the mesh files, sees the same scene.

Everything is a scalar, a text or one numeric array; ragged things (vertices of each mesh, pixels of each texture) are
laid end to end with an offset table. The alternative, sending file names, lost: the other host has no such files, and a
file can change between two readings.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MOST_BYTES = 1 << 30  # [B] of one array: 8 million triangles, or the texels of five pictures of 8192 x 8192

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]


@dataclass
class SceneDescription:
    """Bodies, parts, meshes and materials of one world.

    Attributes
    ----------
    time : microseconds, when `body_poses` were true in the world.
    content_hash : hexadecimal SHA-256 of everything but `time` and `body_poses`.
    text : JSON object with the lists of names "bodies", "parts", "meshes", "materials", and "warnings".
    body_poses : (bodies, 4, 4) float64, X_WB [m].
    body_moving : (bodies,) int64, 1 when the body may be moved.
    part_body, part_mesh, part_material : (parts,) int64 indices.
    part_poses : (parts, 4, 4) float64, X_BM [m].
    vertex_start, face_start : (meshes + 1,) int64, where each mesh begins in `vertices` and `faces`.
    vertices : (n, 3) float64 [m] in M; normals : (n, 3) float32 unit; uv : (n, 2) float32, NaN where a mesh has none.
    faces : (m, 3) int32, counted from the first vertex of their own mesh.
    reflectance : (materials,) float64 [-].
    normal_map, reflectance_map : (materials,) int64 index of a texture, -1 for none.
    texture_shape : (textures, 3) int64 height, width, channels.
    texture_start : (textures + 1,) int64; texels : (n,) uint8, row by row, first row on top.
    """

    time: int
    content_hash: str
    text: str
    body_poses: FloatArray
    body_moving: IndexArray
    part_body: IndexArray
    part_mesh: IndexArray
    part_material: IndexArray
    part_poses: FloatArray
    vertex_start: IndexArray
    face_start: IndexArray
    vertices: FloatArray
    normals: NDArray[np.float32]
    uv: NDArray[np.float32]
    faces: NDArray[np.int32]
    reflectance: FloatArray
    normal_map: IndexArray
    reflectance_map: IndexArray
    texture_shape: IndexArray
    texture_start: IndexArray
    texels: NDArray[np.uint8]

    def validate(self) -> None:
        """Raise ValueError that names the array whose length contradicts the others."""
        expected = {
            "body_moving": len(self.body_poses),
            "part_mesh": len(self.part_body),
            "part_material": len(self.part_body),
            "part_poses": len(self.part_body),
            "face_start": len(self.vertex_start),
            "normals": len(self.vertices),
            "uv": len(self.vertices),
            "normal_map": len(self.reflectance),
            "reflectance_map": len(self.reflectance),
            "texture_start": len(self.texture_shape) + 1,
        }
        for name, length in expected.items():
            if len(getattr(self, name)) != length:
                raise ValueError(f"SceneDescription.{name} must have {length} rows, got {len(getattr(self, name))}")
        ends = ((self.vertex_start, "vertices"), (self.face_start, "faces"), (self.texture_start, "texels"))
        for start, name in ends:
            if len(start) == 0 or start[0] != 0 or start[-1] != len(getattr(self, name)) or np.any(np.diff(start) < 0):
                raise ValueError(f"SceneDescription.{name} does not end where its offset table says")


@dataclass
class BodyPoses:
    """Where every body of one world is, at one time.

    Attributes
    ----------
    time : microseconds, when the poses were true in the world.
    content_hash : of the SceneDescription whose bodies these are, in its order.
    poses : (bodies, 4, 4) float64, X_WB [m].
    """

    time: int
    content_hash: str
    poses: FloatArray

    def validate(self) -> None:
        """Raise ValueError when `poses` is not a finite (bodies, 4, 4)."""
        if self.poses.ndim != 3 or self.poses.shape[1:] != (4, 4):
            raise ValueError(f"BodyPoses.poses must be (bodies, 4, 4), got {self.poses.shape}")
        if not np.isfinite(self.poses).all():
            raise ValueError("BodyPoses.poses holds NaN or infinite numbers")
