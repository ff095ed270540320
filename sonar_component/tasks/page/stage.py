"""What stands in the 3-D world: the scene's parts, and for each sonar its body, sector, trail and last image.

Coordinates count from an origin near the first sonar, in float64 until then: float32 in the browser cannot hold metres
at 5e6 m. Every assignment to a node is a message to every browser, so only what changed is assigned.
"""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sonar_component.pictures.colours import Tone, paint
from sonar_component.pictures.fan import beam_edges, fan_map
from sonar_component.samples import Sonar
from sonar_component.samples.rigid_body_state import quaternion_from_rpy, rotation_from_quaternion
from sonar_component.scene.world import World as Scene
from sonar_component.tasks.page.board import Board, Channel

_FAN_PERIOD = 0.5  # [s], between two laid fans: each is a PNG picture encoded here
_FAN_SIZE = 400  # [pixels]
_TRAIL = 1000  # [-] segments
_TRAIL_STEP = 0.1  # [m], a standing vehicle does not wear its trail out
_ARC = 24  # [-] segments of a sector's arc
_SEAFLOOR, _OBJECT, _MOVING = (150, 130, 95), (120, 145, 160), (200, 120, 60)  # sRGB
_SECTOR, _TRACK = (255, 200, 60), (60, 220, 255)  # sRGB
_NO_SHADOWS = {"cast_shadow": False, "receive_shadow": False}  # in the browser; they cost frames and are not sound's


@dataclass
class _Sensor:
    """What stands in the world for one sonar."""

    sector_of: bytes = b""
    trail: deque[NDArray[np.float64]] = field(default_factory=lambda: deque(maxlen=_TRAIL + 1))
    fan_version: int = -1
    fan_drawn: float = 0.0


class Stage:
    """Nodes of the 3-D client, kept in step with a scene and with the sonars on a board.

    Parameters
    ----------
    client : viser's scene
    origin : (3,) float64
        Point of the world that the client's coordinates count from [m].
    shown : dict
        What is to be seen: "scene", "sector", "trail" and "fan".
    """

    def __init__(self, client: Any, board: Board, origin: NDArray[np.float64], shown: dict[str, bool]) -> None:
        self._client, self._board, self.origin, self.shown = client, board, origin, shown
        self._scene_version = (-1, -1)
        self._drawn: Scene | None = None
        self._sensors: dict[str, _Sensor] = {}
        self._nodes: dict[str, Any] = {}

    def vehicle(self) -> NDArray[np.float64]:
        """Where the first sonar is, in the client's coordinates [m]."""
        return next((sensor.trail[-1] for sensor in self._sensors.values() if sensor.trail), np.zeros(3))

    def draw_scene(self, scene: Scene) -> None:
        """Show a scene; only what changed since the last time is sent."""
        geometry, pose = self._scene_version if scene is self._drawn else (-1, -1)
        if scene.geometry_version != geometry:
            for name in [n for n in self._nodes if n.startswith("/scene/")]:
                self._nodes.pop(name).remove()
            for body in scene.bodies.values():
                for number, part in enumerate(body.parts):
                    self._add_part(f"/scene/{body.name}/{number}", body, part)
        if (scene.geometry_version, scene.pose_version) != (geometry, pose):
            for body in scene.bodies.values():
                for number, part in enumerate(body.parts):
                    self._place(self._nodes[f"/scene/{body.name}/{number}"], body.X_WB @ part.X_BM)
        self._drawn, self._scene_version = scene, (scene.geometry_version, scene.pose_version)
        for name, node in self._nodes.items():
            if name.startswith("/scene/"):
                _show(node, self.shown["scene"])

    def _add_part(self, name: str, body: Any, part: Any) -> None:
        vertices, faces = np.asarray(part.mesh.vertices, np.float32), np.asarray(part.mesh.faces)
        extent = np.ptp(vertices, axis=0) if len(vertices) else np.zeros(3)
        flat = extent[:2].min() > 5 * max(extent[2], 1e-6)
        colour = _MOVING if body.moving else _SEAFLOOR if flat else _OBJECT
        self._nodes[name] = self._client.add_mesh_simple(
            name, vertices, faces, color=colour, flat_shading=True, side="double", **_NO_SHADOWS
        )

    def _place(self, node: Any, X_W: NDArray[np.float64]) -> None:
        node.position = tuple(X_W[:3, 3] - self.origin)
        node.wxyz = tuple(_quaternion(X_W[:3, :3]))

    def draw_sensor(self, source: str, latest: Sonar) -> None:
        """Show a sonar where its last image says it was."""
        sensor = self._sensors.setdefault(source, _Sensor())
        scene, base = self._client, "/sonar/" + source.replace(".", "_")
        p = latest.sensor_position - self.origin
        if base not in self._nodes:
            self._nodes[base] = scene.add_frame(base, axes_length=0.8, axes_radius=0.04)
            scene.add_box(base + "/body", color=(235, 235, 90), dimensions=(0.9, 0.5, 0.4), position=(-0.45, 0.0, 0.0))
            scene.add_label(base + "/name", source.partition(".")[0], position=(0.0, 0.0, 0.6))
        self._nodes[base].position, self._nodes[base].wxyz = tuple(p), tuple(latest.sensor_orientation)
        self._draw_sector(sensor, base, latest)
        self._draw_trail(sensor, base, p)
        self._draw_fan(sensor, base, self._board.channels[source])

    def _draw_sector(self, sensor: _Sensor, base: str, sonar: Sonar) -> None:
        reach = sonar.bin_count * sonar.bin_length
        shape = np.concatenate([sonar.bearings, [sonar.beam_width, sonar.beam_height, reach]])
        if sensor.sector_of != shape.tobytes():
            sensor.sector_of = shape.tobytes()
            points = _sector_lines(sonar).astype(np.float32)
            self._nodes[base + "/sector"] = self._client.add_line_segments(
                base + "/sector", points, colors=_SECTOR, thickness=1.5, thickness_units="screen"
            )
        _show(self._nodes[base + "/sector"], self.shown["sector"])

    def _draw_trail(self, sensor: _Sensor, base: str, p: NDArray[np.float64]) -> None:
        name = "/trail" + base
        if not sensor.trail or np.linalg.norm(p - sensor.trail[-1]) > _TRAIL_STEP:
            sensor.trail.append(p)
            if len(sensor.trail) > 1:
                points = np.asarray(sensor.trail, np.float32)
                segments = np.stack([points[:-1], points[1:]], axis=1)
                if name in self._nodes:
                    self._nodes[name].points = segments
                else:
                    self._nodes[name] = self._client.add_line_segments(
                        name, segments, colors=_TRACK, thickness=2.0, thickness_units="screen"
                    )
        if name in self._nodes:
            _show(self._nodes[name], self.shown["trail"])

    def _draw_fan(self, sensor: _Sensor, base: str, channel: Channel) -> None:
        name, wanted, now = "/fan" + base, self.shown["fan"], time.monotonic()
        if name in self._nodes:
            _show(self._nodes[name], wanted)
        if not wanted or sensor.fan_version == channel.version or now - sensor.fan_drawn < _FAN_PERIOD:
            return
        with self._board.lock:
            sensor.fan_version, sensor.fan_drawn = channel.version, now
            sonar, tone = channel.picture(), Tone(channel.ceiling or 1.0)
        table = fan_map(sonar, _FAN_SIZE)
        values = table.apply(sonar.bins)
        picture = np.dstack([paint(values, tone), np.where(np.isnan(values), 0, 255).astype(np.uint8)])
        left, right, bottom, top = table.extent
        R_WS = rotation_from_quaternion(sonar.sensor_orientation)
        middle = sonar.sensor_position - self.origin + R_WS @ np.array([(top + bottom) / 2, (left + right) / 2, 0.0])
        # viser's picture lies in its own XY plane, X along the columns and Y down the rows: columns run to the sonar's
        # right (-y) and rows run backwards (-x).
        R_SP = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
        self._nodes[name] = self._client.add_image(
            name,
            picture,
            left - right,
            top - bottom,
            format="png",
            **_NO_SHADOWS,
            wxyz=tuple(_quaternion(R_WS @ R_SP)),
            position=tuple(middle),
        )


def _show(node: Any, visible: bool) -> None:
    if node.visible != visible:  # each assignment is a message to every browser
        node.visible = visible


def _sector_lines(sonar: Sonar) -> NDArray[np.float64]:
    """Outline of a sonar's sector as (n, 2, 3) line segments in S [m]: two arcs and the edges."""
    edges = beam_edges(np.sort(sonar.bearings), sonar.beam_width)
    half = sonar.beam_height / 2 if np.isfinite(sonar.beam_height) else 0.0
    reach = sonar.bin_count * sonar.bin_length
    az = np.linspace(edges[0], edges[-1], _ARC + 1 if len(edges) > 2 else 2)
    arcs = []
    for el in (-half, half):
        ray = [np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.full(az.shape, np.sin(el))]
        arcs.append(np.stack(ray, axis=1) * reach)
    lines = [np.stack([arc[:-1], arc[1:]], axis=1) for arc in arcs]
    corners = np.array([arcs[0][0], arcs[0][-1], arcs[1][0], arcs[1][-1]])
    lines.append(np.stack([np.zeros((4, 3)), corners], axis=1))
    lines.append(np.array([[arcs[0][0], arcs[1][0]], [arcs[0][-1], arcs[1][-1]]]))
    return np.concatenate(lines)


def _quaternion(R: NDArray[np.float64]) -> NDArray[np.float64]:
    """Quaternion (w, x, y, z) of a rotation matrix, by its ZYX angles."""
    pitch = float(np.arcsin(np.clip(-R[2, 0], -1.0, 1.0)))
    if abs(R[2, 0]) > 1 - 1e-12:  # straight up or down: yaw and roll turn about one axis, so all of it is yaw
        return quaternion_from_rpy(0.0, pitch, float(np.arctan2(-R[0, 1], R[1, 1])))
    return quaternion_from_rpy(float(np.arctan2(R[2, 1], R[2, 2])), pitch, float(np.arctan2(R[1, 0], R[0, 0])))
