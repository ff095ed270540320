"""What travels between tasks: plain dataclasses of arrays, with Rock's field names, units and rules."""

from sonar_component.samples.frame import Frame
from sonar_component.samples.linear_angular_6d_command import LinearAngular6DCommand
from sonar_component.samples.rigid_body_state import RigidBodyState
from sonar_component.samples.sonar import Sonar

__all__ = ["Frame", "LinearAngular6DCommand", "RigidBodyState", "Sonar"]
