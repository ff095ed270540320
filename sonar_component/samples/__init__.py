"""What travels between tasks: plain dataclasses of arrays, with Rock's field names, units and rules."""

from sonar_component.samples.frame import Frame
from sonar_component.samples.rigid_body_state import RigidBodyState
from sonar_component.samples.sonar import Sonar

__all__ = ["Frame", "RigidBodyState", "Sonar"]
