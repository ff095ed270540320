"""The world in 3-D beside the sonar: scene, sensors with sectors and trails, the last image laid where it belongs.

Decision: viser (MIT, 9 MB, its client is one HTML file inside the wheel and loads nothing from elsewhere; 1 s to
import, 63 MB at work) draws it. It knows meshes, lines, images and orbit cameras, which by hand would be a WebGL
program of our own. pythreejs and meshcat were looked at (the first needs a notebook, the second has stood still for
years), VTK and rerun weigh a hundred megabytes. viser takes the next free port when its own is taken and checks no
Origin, so it listens on a loopback port of its own choosing, and the page's server passes messages on: users see one
port. It is imported and started when the first browser asks for the world, so whoever does not look does not pay.
"""

from __future__ import annotations

import asyncio
import contextlib
import io
import logging
import threading
import time
from collections import deque
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from websockets.asyncio.client import connect
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from sonar_component.pictures.colours import Tone, paint
from sonar_component.pictures.fan import beam_edges, fan_map
from sonar_component.samples import Sonar
from sonar_component.samples.rigid_body_state import quaternion_from_rpy, rotation_from_quaternion
from sonar_component.scene.world import World as Scene
from sonar_component.tasks.page.board import Board, Channel

WORLD = "/world"  # path of the 3-D client on the page's server

_PERIOD = 0.2  # [s], between two looks at the sensors
_FAN_PERIOD = 0.5  # [s], between two laid fans: each is a PNG picture encoded here
_FAN_SIZE = 400  # [pixels]
_TRAIL = 1000  # [-] segments
_TRAIL_STEP = 0.1  # [m], a standing vehicle does not wear its trail out
_VIEW_FROM = np.array([-0.45, -0.3, 0.3])  # [-] of the range: behind, to the right and above
_ARC = 24  # [-] segments of a sector's arc
_SEAFLOOR, _OBJECT, _MOVING = (150, 130, 95), (120, 145, 160), (200, 120, 60)  # sRGB
_SECTOR, _TRACK = (255, 200, 60), (60, 220, 255)  # sRGB
_NO_SHADOWS = {"cast_shadow": False, "receive_shadow": False}  # in the browser; they cost frames and are not sound's
_MAX_MESSAGE = 256 << 20  # bytes, of the whole scene in one message


@dataclass
class _Sensor:
    """What stands in the world for one sonar."""

    sector_of: bytes = b""
    trail: deque[NDArray[np.float64]] = field(default_factory=lambda: deque(maxlen=_TRAIL + 1))
    fan_version: int = -1
    fan_drawn: float = 0.0


class World:
    """The 3-D client, started when somebody looks.

    Parameters
    ----------
    board : Board
        Where the sonars' last images are.
    """

    def __init__(self, board: Board, log: logging.Logger) -> None:
        self._board, self._log = board, log
        self._viser: Any = None
        self._starting = threading.Lock()
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._scene: Scene | None = None
        self._scene_version = (-1, -1)
        self._origin = np.full(3, np.nan)
        self._followed = np.full(3, np.nan)
        self._distance = 20.0  # [m], range of the first sonar seen
        self._sensors: dict[str, _Sensor] = {}
        self._nodes: dict[str, Any] = {}
        self._switches: dict[str, Any] = {}

    def page(self) -> bytes:
        """The client's HTML file.

        Raises
        ------
        ImportError
            If viser is not installed; says how to get it.
        """
        from importlib.util import find_spec
        from pathlib import Path

        found = find_spec("viser")
        if found is None or found.origin is None:
            raise ImportError('viser is not installed: pip install "sonar-component[viewer]"')
        return (Path(found.origin).parent / "client" / "build" / "index.html").read_bytes()

    async def join(self, browser: ServerConnection) -> None:
        """Pass messages between a browser and viser until one of them closes."""
        await asyncio.to_thread(self._start)
        protocols = [browser.subprotocol] if browser.subprotocol else None
        address = f"ws://127.0.0.1:{self._viser.get_port()}"
        async with connect(address, subprotocols=protocols, compression=None, max_size=_MAX_MESSAGE) as inner:
            both = [asyncio.create_task(_pump(browser, inner)), asyncio.create_task(_pump(inner, browser))]
            await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)
            for task in both:
                task.cancel()

    def show(self, scene: Scene) -> None:
        """Show this scene; only what changed since the last look is sent."""
        self._scene = scene

    def stop(self) -> None:
        """Stop viser, if it was started."""
        self._stop.set()
        if self._viser is not None:
            # It waits a second for its own thread, which nobody has to see: both threads are daemons.
            threading.Thread(target=self._viser.stop, daemon=True).start()

    def _start(self) -> None:
        with self._starting:
            if self._viser is not None:
                return
            with contextlib.redirect_stdout(io.StringIO()):  # it prints a banner with an address that is not for users
                import viser

                logging.getLogger("websockets.server").setLevel(logging.WARNING)
                self._viser = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
            self._viser.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)
            self._viser.scene.set_up_direction("+z")
            self._add_switches()
            self._thread = threading.Thread(target=self._run, name="world", daemon=True)
            self._thread.start()

    def _add_switches(self) -> None:
        gui = self._viser.gui
        self._switches = {
            "scene": gui.add_checkbox("scene", True),
            "sector": gui.add_checkbox("sectors", True),
            "trail": gui.add_checkbox("trails", True),
            "fan": gui.add_checkbox("last image", False, hint="lay each sonar's last image into the world"),
            "follow": gui.add_checkbox("follow", False, hint="the camera goes along with the first sonar"),
        }
        look = gui.add_button("look at vehicle")
        look.on_click(lambda event: self._look_at_vehicle(event.client))

    def _run(self) -> None:
        while not self._stop.wait(_PERIOD):
            if not self._viser.get_clients():
                continue
            try:
                self._update()
            except Exception:  # a world that cannot be drawn must not end the page
                self._log.exception("3-D world")
                self._stop.wait(5.0)

    def _update(self) -> None:
        with self._board.lock:
            latest = {channel.source: channel.latest for channel in self._board.channels.values()}
        placed = {name: s for name, s in latest.items() if s is not None and np.isfinite(s.sensor_position).all()}
        if placed and np.isnan(self._origin).any():
            self._settle(next(iter(placed.values())))
        if np.isnan(self._origin).any():
            return
        if placed:
            self._follow(next(iter(placed.values())).sensor_position - self._origin)
        with self._viser.atomic():
            self._draw_scene()
            for source, sonar in placed.items():
                self._draw_sensor(source, sonar)

    def _follow(self, p: NDArray[np.float64]) -> None:
        """Take every camera along with the first sonar's step since the last look."""
        step, self._followed = p - self._followed, p
        if self._switches["follow"].value and np.isfinite(step).all() and step.any():
            for client in self._viser.get_clients().values():
                client.camera.position = tuple(np.asarray(client.camera.position) + step)
                client.camera.look_at = tuple(np.asarray(client.camera.look_at) + step)

    def _settle(self, first: Sonar) -> None:
        """Choose the point that 3-D coordinates count from: float32 in the browser cannot hold metres at 5e6 m."""
        self._origin = np.round(first.sensor_position)
        self._distance = first.bin_count * first.bin_length
        self._viser.initial_camera.position = tuple(_VIEW_FROM * self._distance)
        self._viser.initial_camera.look_at = (0.0, 0.0, 0.0)
        for client in self._viser.get_clients().values():
            self._look_at_vehicle(client)

    def _look_at_vehicle(self, client: Any) -> None:
        at = next((s.trail[-1] for s in self._sensors.values() if s.trail), np.zeros(3))
        client.camera.position = tuple(at + _VIEW_FROM * self._distance)
        client.camera.look_at = tuple(at)

    # The scene

    def _draw_scene(self) -> None:
        scene = self._scene
        if scene is None:
            return
        geometry, pose = self._scene_version
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
        self._scene_version = (scene.geometry_version, scene.pose_version)
        for name, node in self._nodes.items():
            if name.startswith("/scene/"):
                _show(node, self._switches["scene"].value)

    def _add_part(self, name: str, body: Any, part: Any) -> None:
        vertices, faces = np.asarray(part.mesh.vertices, np.float32), np.asarray(part.mesh.faces)
        extent = np.ptp(vertices, axis=0) if len(vertices) else np.zeros(3)
        flat = extent[:2].min() > 5 * max(extent[2], 1e-6)
        colour = _MOVING if body.moving else _SEAFLOOR if flat else _OBJECT
        self._nodes[name] = self._viser.scene.add_mesh_simple(
            name, vertices, faces, color=colour, flat_shading=True, side="double", **_NO_SHADOWS
        )

    def _place(self, node: Any, X_W: NDArray[np.float64]) -> None:
        node.position = tuple(X_W[:3, 3] - self._origin)
        node.wxyz = tuple(_quaternion(X_W[:3, :3]))

    # A sonar

    def _draw_sensor(self, source: str, latest: Sonar) -> None:
        sensor = self._sensors.setdefault(source, _Sensor())
        scene, base = self._viser.scene, "/sonar/" + source.replace(".", "_")
        p = latest.sensor_position - self._origin
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
            self._nodes[base + "/sector"] = self._viser.scene.add_line_segments(
                base + "/sector", points, colors=_SECTOR, thickness=1.5, thickness_units="screen"
            )
        _show(self._nodes[base + "/sector"], self._switches["sector"].value)

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
                    self._nodes[name] = self._viser.scene.add_line_segments(
                        name, segments, colors=_TRACK, thickness=2.0, thickness_units="screen"
                    )
        if name in self._nodes:
            _show(self._nodes[name], self._switches["trail"].value)

    def _draw_fan(self, sensor: _Sensor, base: str, channel: Channel) -> None:
        name, wanted, now = "/fan" + base, self._switches["fan"].value, time.monotonic()
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
        middle = sonar.sensor_position - self._origin + R_WS @ np.array([(top + bottom) / 2, (left + right) / 2, 0.0])
        # viser's picture lies in its own XY plane, X along the columns and Y down the rows: columns run to the sonar's
        # right (-y) and rows run backwards (-x).
        R_SP = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
        self._nodes[name] = self._viser.scene.add_image(
            name,
            picture,
            left - right,
            top - bottom,
            format="png",
            **_NO_SHADOWS,
            wxyz=tuple(_quaternion(R_WS @ R_SP)),
            position=tuple(middle),
        )


async def _pump(source: Any, sink: Any) -> None:
    with contextlib.suppress(ConnectionClosed):
        async for message in source:
            await sink.send(message)


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
