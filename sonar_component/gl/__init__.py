"""OpenGL without sonar: a headless context, programs from .glsl files, targets to draw into and read back."""

from sonar_component.gl.context import GLUnavailableError, create_context, is_software
from sonar_component.gl.program import load_program, set_uniforms
from sonar_component.gl.target import Target

__all__ = ["GLUnavailableError", "Target", "create_context", "is_software", "load_program", "set_uniforms"]
