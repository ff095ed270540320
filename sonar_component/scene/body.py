"""A named thing with a pose: what SDF calls a model and Rock a rigid body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonar_component.scene.material import Material
from sonar_component.scene.mesh import Mesh

Pose = NDArray[np.float64]

_ROTATION_TOLERANCE = 1e-6  # [-], what a quaternion written with seven digits gives


@dataclass(frozen=True, eq=False)
class Part:
    """One mesh with one material, fixed in its body.

    Attributes
    ----------
    mesh : may be shared between parts.
    material : of the whole part.
    X_BM : (4, 4) float64, rotation and translation only [m]. It holds the whole-metre offset of a mesh made far
        from its origin (UTM coordinates), so that the mesh itself survives float32.
    name : the visual's or the object's name in its file.
    """

    mesh: Mesh
    material: Material
    X_BM: Pose
    name: str = ""


@dataclass(eq=False)
class Body:
    """Parts that move as one.

    Attributes
    ----------
    name : unique in its world.
    parts : the surfaces.
    X_WB : (4, 4) float64, pose of the body in the world [m].
    moving : True when poses are expected while running; a static body may be merged with others by a renderer.
    """

    name: str
    parts: list[Part]
    X_WB: Pose
    moving: bool = False


def check_pose(X: Pose, who: str) -> Pose:
    """Return X as a fresh (4, 4) float64; raise ValueError naming `who` when it is not a finite rigid pose."""
    X = np.array(X, dtype=np.float64)
    if X.shape != (4, 4):
        raise ValueError(f"pose of '{who}' must be a 4 x 4 matrix, got shape {X.shape}")
    if not np.isfinite(X).all():
        raise ValueError(f"pose of '{who}' holds NaN or infinite numbers")
    R = X[:3, :3]
    rigid = np.abs(R @ R.T - np.eye(3)).max() < _ROTATION_TOLERANCE and np.linalg.det(R) > 0
    if not rigid or np.any(X[3] != (0.0, 0.0, 0.0, 1.0)):
        raise ValueError(f"pose of '{who}' must be a rotation and a translation, got {X.round(4).tolist()}")
    return X
