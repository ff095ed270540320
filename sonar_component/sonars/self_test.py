"""A known target, rendered and compared with its closed form: whether the picture is right on this machine."""

from __future__ import annotations

import numpy as np

from sonar_component.gl import Context
from sonar_component.samples import RigidBodyState
from sonar_component.scene import Body, Material, Mesh, Part, World
from sonar_component.sonars.forward_looking import ForwardLookingSonar
from sonar_component.sonars.settings import ForwardLookingSettings

_DISTANCE = 6.0  # [m], of the wall
_TOLERANCE = 0.005  # [-], of the energy: ten times the quantisation of a sample's strength, summed


def wall_ahead(distance: float) -> World:
    """A square wall across the X axis, large enough to fill a narrow fan."""
    y, z = np.array([-1.0, 1.0, 1.0, -1.0]) * 50, np.array([-1.0, -1.0, 1.0, 1.0]) * 50
    vertices = np.stack([np.full(4, distance), y, z], axis=1)
    normals = np.tile(np.array([-1.0, 0.0, 0.0], np.float32), (4, 1))
    mesh = Mesh(vertices, normals, np.array([[0, 1, 2], [0, 2, 3]], np.int32))
    return World([Body("wall", [Part(mesh, Material("plain"), np.eye(4))], np.eye(4))])


def known_target(context: Context) -> list[tuple[str, bool, str]]:
    """Ping a wall 6 m ahead and compare with the truth.

    Returns
    -------
    list of (what, passed, in words)
    """
    settings = ForwardLookingSettings(
        range=10.0, bin_count=500, beam_count=64, beam_width=1.0, beam_height=0.2, normalization="energy"
    )
    sonar = ForwardLookingSonar(context, settings)
    pose = RigidBodyState(time=1, position=np.zeros(3), orientation=np.array([1.0, 0.0, 0.0, 0.0]))
    sample = sonar.ping(wall_ahead(_DISTANCE), pose)
    sonar.release()
    first = sample.bins.argmax(axis=1)
    # Seen along a bearing, the wall begins at d / cos(bearing), at zero elevation, and is brightest there.
    nearest = _DISTANCE / np.cos(sample.bearings) / sample.bin_length
    worst = float(np.abs(first + 0.5 - nearest).max())
    # A wall returns the cosine of incidence, cos(bearing) cos(elevation); integrate over the sector of each beam.
    half_height, half_width = settings.beam_height / 2, settings.beam_width / settings.beam_count / 2
    over_elevation = half_height + np.sin(2 * half_height) / 2
    over_bearing = 2 * np.cos(sample.bearings) * np.sin(half_width)
    truth = over_elevation * over_bearing / (4 * half_width * np.sin(half_height))
    error = float(np.abs(sample.bins.sum(axis=1) / truth - 1).max())
    return [
        ("range", worst <= 1.5, f"a wall at {_DISTANCE:g} m stands in the right bin, at most {worst:.2f} bins off"),
        ("energy", error <= _TOLERANCE, f"its echo is within {error:.2%} of the closed form in every beam"),
    ]
