"""Real-time simulator of imaging sonar: a library that renders pings, and a graph of tasks that sends them.

The way of one image, a room for each step:

    deploy/demo.yaml                what runs, read and checked by middleware/deployment/
    tasks/multibeam_sonar.py        a task: reads a pose from its port, asks the library, writes the image
    sonars/forward_looking.py       ping(world, pose) -> Sonar: composes the next four rooms
    scene/                          the world: bodies with poses, meshes, materials
    render/                         world and pose -> samples (range, span of ranges, strength), drawn by OpenGL (gl/)
    echo/                           samples -> beams x bins
    noise/                          beams x bins -> beams x bins, given a random generator
    samples/sonar.py                the image that travels: Rock's fields and units
    middleware/codec.py, transport/ onto the port, and off it in another process

Beside the way: settings/ (YAML with units), acoustics/ (formulas), pictures/ (PNG figures), devices/ (the wire formats
of real sonars), cli/ (the command ``sonar``). Imports go down only; pyproject.toml holds the rule.

Symbols, the same in Python and GLSL: frames W world, S sonar, M model, B body, D clip; X_WS is the pose of S in W, p_SV
a point seen from S, n_S a normal in S. X forward, Y left, Z up. Arrays are (beams, bins). SI units; time is in
microseconds.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sonar_component.gl import create_context
    from sonar_component.middleware import connect
    from sonar_component.samples import Frame, RigidBodyState, Sonar
    from sonar_component.scene import load_world
    from sonar_component.sonars.forward_looking import ForwardLookingSonar
    from sonar_component.sonars.settings import ForwardLookingSettings

# Imported when first asked for: who reads a port needs no OpenGL, who renders needs no ports.
_PLACES = {
    "ForwardLookingSettings": "sonars.settings",
    "ForwardLookingSonar": "sonars.forward_looking",
    "Frame": "samples",
    "RigidBodyState": "samples",
    "Sonar": "samples",
    "connect": "middleware",
    "create_context": "gl",
    "load_world": "scene",
}

__all__ = [
    "ForwardLookingSettings",
    "ForwardLookingSonar",
    "Frame",
    "RigidBodyState",
    "Sonar",
    "connect",
    "create_context",
    "load_world",
]


def __getattr__(name: str) -> Any:
    if name in _PLACES:
        return getattr(import_module(f"{__name__}.{_PLACES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
