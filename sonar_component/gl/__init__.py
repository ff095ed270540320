"""OpenGL without sonar: a headless context, programs from .glsl files, targets to draw into and read back."""

from sonar_component.gl.context import Context, GLUnavailableError, create_context, is_software
from sonar_component.gl.program import load_program, set_uniforms
from sonar_component.gl.target import Target

__all__ = ["Context", "GLUnavailableError", "Target", "create_context", "is_software", "load_program", "set_uniforms"]
