"""OpenGL without sonar: a headless context, programs from .glsl files, targets to draw into and read back."""

from sonar_component.gl.context import Context, GLUnavailableError, create_context, is_software
from sonar_component.gl.program import load_program, set_uniforms
from sonar_component.gl.shared import SharedContext, share_context
from sonar_component.gl.target import Target

__all__ = [
    "Context",
    "GLUnavailableError",
    "SharedContext",
    "Target",
    "create_context",
    "is_software",
    "load_program",
    "set_uniforms",
    "share_context",
]
