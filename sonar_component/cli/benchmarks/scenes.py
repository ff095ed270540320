"""The standard scenes of the benchmarks, made of shapes, so that they need no files."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonar_component.samples import RigidBodyState
from sonar_component.samples.rigid_body_state import quaternion_from_rpy
from sonar_component.scene import Body, Material, Mesh, Part, World, shapes

_PLAIN = Material("plain")


@dataclass(frozen=True)
class Case:
    """A world, where the sonar is in it, and how far it hears [m]."""

    name: str
    world: World
    pose: RigidBodyState
    range: float = 30.0


def comparison() -> Case:
    """Floor, sphere and box: the scene on which the original simulator and Stonefish were timed."""
    bodies = [
        _body("floor", shapes.plane((200.0, 200.0)), (0, 0, 0)),
        _body("sphere", shapes.sphere(1.5), (12, -3, 1.5)),
        _body("box", shapes.box((3.0, 2.0, 2.0)), (15, 4, 1)),
    ]
    return Case("comparison", World(bodies), looking(0, 0, 3, pitch=15))


def rolling() -> Case:
    """A rolling sea floor of 8192 triangles whose crests throw many shadows."""
    return Case("rolling", World([_body("floor", terrain(64, 80.0), (0, 0, 0))]), looking(0, 0, 4, pitch=15))


def grazing() -> Case:
    """A level sonar 5 m above a flat floor with four balls, out to 50 m: a row of samples spans many bins there."""
    bodies = [_body("floor", shapes.plane((400.0, 400.0)), (0, 0, 0))]
    for k, (x, y) in enumerate(((31.0, -14.0), (34.0, 6.0), (40.0, -4.0), (44.0, 15.0))):
        bodies.append(_body(f"ball {k}", shapes.sphere(1.5), (x, y, 1.5)))
    return Case("grazing", World(bodies), looking(0, 0, 5), range=50.0)


def tank() -> Case:
    """A square tank of 16 m, seen from its middle."""
    walls = [
        _body("bottom", shapes.plane((16.0, 16.0)), (0, 0, -4)),
        *(
            _body(f"wall {k}", shapes.box((0.2, 16.4, 8.0)), (8.1 * np.cos(a), 8.1 * np.sin(a), 0), yaw=float(a))
            for k, a in enumerate(np.arange(4) * np.pi / 2)
        ),
    ]
    return Case("tank", World(walls), looking(0, 0, 0))


def crowd(count: int) -> Case:
    """The comparison scene and `count` more spheres on its floor, in and out of sight."""
    base = comparison()
    rng = np.random.default_rng(1)
    mesh = shapes.sphere(0.4)
    for k, (x, y) in enumerate(rng.uniform((-40, -40), (40, 40), (count, 2))):
        base.world.add(_body(f"ball {k}", mesh, (x, y, 0.4)))
    return Case(f"{count + 2} objects", base.world, base.pose)


def plain(triangles: int, size: float) -> Case:
    """A gently rolling floor of about so many triangles over `size` x `size` metres.

    Without crests that throw shadows, so that what a frame costs comes from triangles and not from their edges.
    """
    side = max(2, round((triangles / 2) ** 0.5))
    return Case(
        f"{2 * side * side} triangles",
        World([_body("floor", terrain(side, size, steepness=0.08), (0, 0, 0))]),
        looking(0, 0, 4, pitch=15),
    )


def terrain(cells: int, size: float, steepness: float = 1.0) -> Mesh:
    """A square of rolling floor, its heights times `steepness`; closed form, smooth normals."""
    line = np.linspace(-size / 2, size / 2, cells + 1)
    x, y = np.meshgrid(line, line, indexing="ij")
    bend = 0.55 * x + 1.1 * np.sin(0.31 * y)
    z = 0.8 * np.sin(bend) * np.cos(0.47 * y) + 0.5 * np.sin(1.1 * x + 0.9 * y)
    dx = 0.44 * np.cos(bend) * np.cos(0.47 * y) + 0.55 * np.cos(1.1 * x + 0.9 * y)
    dy = 0.8 * (np.cos(bend) * 0.341 * np.cos(0.31 * y) * np.cos(0.47 * y) - 0.47 * np.sin(bend) * np.sin(0.47 * y))
    dy += 0.45 * np.cos(1.1 * x + 0.9 * y)
    normals = np.stack([-steepness * dx, -steepness * dy, np.ones_like(dx)], axis=-1).reshape(-1, 3)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    vertices = np.stack([x, y, steepness * z], axis=-1).reshape(-1, 3)
    return Mesh(vertices, normals.astype(np.float32), shapes.grid_faces(cells + 1, cells + 1))


def looking(x: float, y: float, z: float, pitch: float = 0.0, time: int = 1) -> RigidBodyState:
    """A pose at (x, y, z) [m], nose down by `pitch` [deg]."""
    return RigidBodyState(
        time=time,
        sourceFrame="sonar",
        targetFrame="world",
        position=np.array([x, y, z], np.float64),
        orientation=quaternion_from_rpy(0.0, float(np.radians(pitch)), 0.0),
    )


def _body(name: str, mesh: Mesh, position: tuple[float, float, float], yaw: float = 0.0) -> Body:
    X_WB = np.eye(4)
    X_WB[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    X_WB[:3, 3] = position
    return Body(name, [Part(mesh, _PLAIN, np.eye(4))], X_WB)
