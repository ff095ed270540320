"""Poses in a user's words."""

from __future__ import annotations

from typing import Any

import numpy as np

from sonar_component.samples import RigidBodyState
from sonar_component.samples.rigid_body_state import quaternion_from_rpy


def pose(position: Any = (0, 0, 0), rpy_deg: Any = (0, 0, 0), time: int = 1) -> RigidBodyState:
    """A positive pitch turns the nose down, a positive yaw to the left."""
    orientation = quaternion_from_rpy(*np.radians(rpy_deg))
    return RigidBodyState(time=time, position=np.array(position, float), orientation=orientation)
