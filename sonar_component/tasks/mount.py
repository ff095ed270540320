"""Where a sensor sits on its vehicle: a static transform, in place or by name from the vehicle's file.

version: 1
mounts:
  fls: {position: [1.0 m, 0, -0.2 m], rpy: [0, 10 deg, 0]}
  msis_top: {position: [0.8 m, 0, 0.3 m]}
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from sonar_component.samples import RigidBodyState
from sonar_component.samples.motion import mounted
from sonar_component.samples.rigid_body_state import quaternion_from_rpy, rotation_from_quaternion
from sonar_component.settings import SettingsError, find_file, load_yaml, validate
from sonar_component.settings.errors import suggest
from sonar_component.settings.quantity import Angle, Length

Coordinate = Annotated[Length, Field(allow_inf_nan=False)]
Rotation = Annotated[Angle, Field(allow_inf_nan=False)]


class MountProperties(BaseModel):
    """Pose of a sensor in its vehicle's frame: X forward, Y left, Z up; a positive pitch is nose down."""

    model_config = ConfigDict(extra="forbid", defer_build=True)

    position: tuple[Coordinate, Coordinate, Coordinate] = (0.0, 0.0, 0.0)
    rpy: tuple[Rotation, Rotation, Rotation] = (0.0, 0.0, 0.0)


class VehicleFile(BaseModel):
    """A vehicle: its mounts by name."""

    model_config = ConfigDict(extra="forbid", defer_build=True)

    version: Literal[1]
    mounts: dict[str, MountProperties]


class Mount:
    """Turns the vehicle's pose into the sensor's."""

    def __init__(self, properties: MountProperties, frame: str) -> None:
        self._frame = frame
        self._q_VS = quaternion_from_rpy(*properties.rpy)
        self._X_VS: NDArray[np.float64] = np.eye(4)
        self._X_VS[:3, :3] = rotation_from_quaternion(self._q_VS)
        self._X_VS[:3, 3] = properties.position

    def pose(self, vehicle: RigidBodyState) -> RigidBodyState:
        """Pose and velocity of the sensor in the world."""
        return mounted(vehicle, self._X_VS, self._q_VS, self._frame)


def find_mount(vehicle: str, name: str, beside: str | Path | None) -> MountProperties:
    """Look a mount up in a vehicle's file.

    Raises
    ------
    SettingsError
        If the file is wrong or has no mount of that name; names the nearest.
    """
    document = load_yaml(find_file(vehicle, beside))
    mounts = validate(VehicleFile, document).mounts
    if name not in mounts:
        known = ", ".join(mounts) or "none"
        raise SettingsError(f"has no mount {name!r}{suggest(name, mounts)}; it has: {known}", vehicle)
    return mounts[name]
