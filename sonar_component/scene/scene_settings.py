"""What may stand in a scene YAML: bodies with shapes or mesh files, poses with units, materials.

version: 1
materials:
  steel: {reflectance: 1.4, normal_map: plates.png}
bodies:
  wreck: {mesh: wreck.glb, pose: {position: [14 m, 0, -6 m], rpy: [0, 0, 30 deg]}, material: steel}
  buoy: {sphere: {radius: 0.4 m}, moving: true}
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from sonar_component.settings.quantity import Angle, Length, Ratio


def _positive(value: float) -> float:
    if not (np.isfinite(value) and value > 0):
        raise ValueError(f"must be greater than 0, got {value}")
    return value


def _finite(value: float) -> float:
    if not np.isfinite(value):
        raise ValueError(f"must be a finite number, got {value}")
    return value


def _unit(value: Any) -> Any:
    # "mm" alone is how people say it.
    return f"1 {value}" if isinstance(value, str) and value.strip().isalpha() else value


def _triple(value: Any) -> Any:
    return value if isinstance(value, (list, tuple)) else [value] * 3


PositiveLength = Annotated[Length, AfterValidator(_positive)]
PositiveRatio = Annotated[Ratio, AfterValidator(_positive)]
Coordinate = Annotated[Length, AfterValidator(_finite)]
Rotation = Annotated[Angle, AfterValidator(_finite)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class PoseSettings(_Strict):
    """Where something is: position [m], and either rpy [rad] (about fixed X, Y, Z in this order) or (w, x, y, z)."""

    position: tuple[Coordinate, Coordinate, Coordinate] = (0.0, 0.0, 0.0)
    rpy: tuple[Rotation, Rotation, Rotation] | None = None
    quaternion: tuple[float, float, float, float] | None = None

    @model_validator(mode="after")
    def _one_orientation(self) -> PoseSettings:
        if self.rpy is not None and self.quaternion is not None:
            raise ValueError("give rpy or quaternion, got both")
        if self.quaternion is not None and abs(np.linalg.norm(self.quaternion) - 1) > 1e-3:
            raise ValueError(f"quaternion (w, x, y, z) must have length 1, got {list(self.quaternion)}")
        return self


class MaterialSettings(_Strict):
    """How a surface echoes: reflectance R > 0, and pictures in texture coordinates.

    `texture_size` lays pictures on at that size, whatever texture coordinates the mesh has; without it, a mesh keeps
    its own, and one that has none gets them at 1 m.
    """

    reflectance: PositiveRatio = 1.0
    normal_map: str | None = None
    reflectance_map: str | None = None
    texture_size: PositiveLength | None = None


class BoxSettings(_Strict):
    """Edges along X, Y, Z."""

    size: tuple[PositiveLength, PositiveLength, PositiveLength]


class SphereSettings(_Strict):
    """A ball around the body's origin."""

    radius: PositiveLength


class CylinderSettings(_Strict):
    """A closed cylinder along Z; a capsule's half balls come on top of its length."""

    radius: PositiveLength
    length: PositiveLength


class EllipsoidSettings(_Strict):
    """Half axes along X, Y, Z."""

    radii: tuple[PositiveLength, PositiveLength, PositiveLength]


class PlaneSettings(_Strict):
    """A rectangle around the body's origin."""

    size: tuple[PositiveLength, PositiveLength] = (200.0, 200.0)
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)

    @model_validator(mode="after")
    def _has_direction(self) -> PlaneSettings:
        if not np.isfinite(self.normal).all() or np.linalg.norm(self.normal) == 0:
            raise ValueError(f"normal must have a direction, got {list(self.normal)}")
        return self


class TerrainSettings(_Strict):
    """A sea floor from a grid of heights: a grey picture (white is `size[2]` high) or an .npy of metres."""

    heights: str
    size: tuple[PositiveLength, PositiveLength, PositiveLength]


class BodySettings(_Strict):
    """One body: exactly one of mesh, SDF model or shape."""

    mesh: str | None = None
    box: BoxSettings | None = None
    sphere: SphereSettings | None = None
    cylinder: CylinderSettings | None = None
    capsule: CylinderSettings | None = None
    ellipsoid: EllipsoidSettings | None = None
    plane: PlaneSettings | None = None
    terrain: TerrainSettings | None = None
    sdf: str | None = None

    pose: PoseSettings = PoseSettings()
    material: str | MaterialSettings | None = None
    materials: dict[str, str | MaterialSettings] = {}
    moving: bool = False
    scale: Annotated[tuple[PositiveRatio, PositiveRatio, PositiveRatio], BeforeValidator(_triple)] = (1.0, 1.0, 1.0)
    unit: Annotated[PositiveLength | None, BeforeValidator(_unit)] = Field(
        default=None, description="length of 1 in the mesh file, such as mm"
    )
    up: Literal["x", "y", "z"] | None = None

    @model_validator(mode="after")
    def _one_shape(self) -> BodySettings:
        given = [kind for kind in KINDS if getattr(self, kind) is not None]
        if len(given) != 1:
            raise ValueError(f"must have exactly one of {', '.join(KINDS)}, got {' and '.join(given) or 'none'}")
        return self


KINDS = ("mesh", "box", "sphere", "cylinder", "capsule", "ellipsoid", "plane", "terrain", "sdf")


class SceneSettings(_Strict):
    """A whole scene file.

    `include` names SDF worlds whose models become bodies here. `materials` also dress every surface whose material has
    that name in its own mesh or SDF file, unless its body says otherwise.
    """

    version: Literal[1]
    materials: dict[str, MaterialSettings] = {}
    include: list[str] = []
    bodies: dict[str, BodySettings] = {}
