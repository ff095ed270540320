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
from typing import Any

import numpy as np
from numpy.typing import NDArray
from websockets.asyncio.client import connect
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from sonar_component.samples import Sonar
from sonar_component.scene.world import World as Scene
from sonar_component.tasks.page.board import Board
from sonar_component.tasks.page.stage import Stage

WORLD = "/world"  # path of the 3-D client on the page's server

_PERIOD = 0.2  # [s], between two looks at the sensors
_AFTER_FAILURE = 5.0  # [s]
_VIEW_FROM = np.array([-0.45, -0.3, 0.3])  # [-] of the range: behind, to the right and above
_MAX_MESSAGE = 256 << 20  # bytes, of the whole scene in one message


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
        self._scene: Scene | None = None
        self._stage: Stage | None = None
        self._distance = 20.0  # [m], range of the first sonar seen
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
            threading.Thread(target=self._run, name="world", daemon=True).start()

    def _add_switches(self) -> None:
        gui = self._viser.gui
        self._switches = {
            "scene": gui.add_checkbox("scene", True),
            "sector": gui.add_checkbox("sectors", True),
            "trail": gui.add_checkbox("trails", True),
            "fan": gui.add_checkbox("last image", False, hint="lay each sonar's last image into the world"),
            "follow": gui.add_checkbox("follow", False, hint="the camera goes along with the first sonar"),
        }
        gui.add_button("look at vehicle").on_click(lambda event: self._look_at_vehicle(event.client))

    def _run(self) -> None:
        while not self._stop.wait(_PERIOD):
            if not self._viser.get_clients():
                continue
            try:
                self._update()
            except Exception:  # a world that cannot be drawn must not end the page
                self._log.exception("3-D world")
                self._stop.wait(_AFTER_FAILURE)

    def _update(self) -> None:
        with self._board.lock:
            latest = {channel.source: channel.latest for channel in self._board.channels.values()}
        placed = {name: sonar for name, sonar in latest.items() if sonar is not None and _is_placed(sonar)}
        if self._stage is None and placed:
            self._settle(next(iter(placed.values())))
        if self._stage is None:
            return
        self._stage.shown = {name: switch.value for name, switch in self._switches.items()}
        before = self._stage.vehicle()
        with self._viser.atomic():
            if self._scene is not None:
                self._stage.draw_scene(self._scene)
            for source, sonar in placed.items():
                self._stage.draw_sensor(source, sonar)
        if self._switches["follow"].value:
            self._take_along(self._stage.vehicle() - before)

    def _settle(self, first: Sonar) -> None:
        """Choose the origin, and where to look from."""
        self._stage = Stage(self._viser.scene, self._board, np.round(first.sensor_position), {})
        self._distance = first.bin_count * first.bin_length
        self._viser.initial_camera.position = tuple(_VIEW_FROM * self._distance)
        self._viser.initial_camera.look_at = (0.0, 0.0, 0.0)
        for client in self._viser.get_clients().values():
            self._look_at_vehicle(client)

    def _look_at_vehicle(self, client: Any) -> None:
        at = self._stage.vehicle() if self._stage is not None else np.zeros(3)
        client.camera.position = tuple(at + _VIEW_FROM * self._distance)
        client.camera.look_at = tuple(at)

    def _take_along(self, step: NDArray[np.float64]) -> None:
        """Move every camera by the vehicle's step [m]."""
        if step.any():
            for client in self._viser.get_clients().values():
                client.camera.position = tuple(np.asarray(client.camera.position) + step)
                client.camera.look_at = tuple(np.asarray(client.camera.look_at) + step)


def _is_placed(sonar: Sonar) -> bool:
    return bool(np.isfinite(sonar.sensor_position).all() and np.isfinite(sonar.sensor_orientation).all())


async def _pump(source: Any, sink: Any) -> None:
    with contextlib.suppress(ConnectionClosed):
        async for message in source:
            await sink.send(message)
