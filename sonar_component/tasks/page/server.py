"""Serves the page, its images and its controls on one port, to any number of browsers.

Decision: built on websockets (kept, BSD, 1.6 MB, nothing to compile), which viser stands on too. viser itself draws the
3-D world (see world.py), but not the sonar: it shows images as JPEG or PNG encoded in Python for every frame, has no
cursor over them, and one panel of widgets beside them, while a fan wants rings, ticks and the value under the pointer.
NiceGUI (FastAPI and socket.io, 40 packages) and Panel or Dash (Tornado or Flask with a plotting client) were looked at:
heavier, and a redraw goes through the server. rerun is a 100 MB viewer without controls; Foxglove's client is not in
its wheel. So the page is plain HTML and JavaScript in this package: no build step, no download.
"""

from __future__ import annotations

import asyncio
import json
import logging
import socket
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from websockets.asyncio.server import ServerConnection, serve
from websockets.typing import Subprotocol

from sonar_component.samples import Sonar
from sonar_component.tasks.page.board import Board
from sonar_component.tasks.page.session import Backstage, Control, Session
from sonar_component.tasks.page.site import Site
from sonar_component.tasks.page.world import WORLD, World

_STATUS_PERIOD = 0.5  # [s]
_CLOSING = 0.3  # [s], for browsers to say goodbye: a task that stops is given 1.5 s in all
_MAX_REQUEST = 64 * 1024  # bytes, of a message from a page; the largest is a list of bearings


class PageServer:
    """The page of one viewer task, in a thread of its own.

    Parameters
    ----------
    board : Board
        What to show.
    control : Control
        What a page may ask for.
    now : function
        Data time [us], to tell how old an image is.
    files : function
        (request, image) -> (file name, content) for "save" requests; runs in a worker thread.
    """

    def __init__(
        self,
        board: Board,
        control: Control,
        now: Callable[[], int],
        files: Callable[[dict[str, Any], Sonar], tuple[str, bytes]],
        world: World,
        log: logging.Logger,
    ) -> None:
        self._workers = ThreadPoolExecutor(2, thread_name_prefix="page")
        self._backstage = Backstage(board, control, now, files, self._workers, log)
        self.world = world
        self._sessions: set[Session] = set()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None
        self._done: asyncio.Event | None = None
        self._status = json.dumps({"kind": "status", "sonars": {}, "tasks": []})
        self.port = 0

    @property
    def clients(self) -> int:
        """How many pages are open."""
        return len(self._sessions)

    def start(self, address: str, port: int) -> None:
        """Begin to serve.

        Raises
        ------
        OSError
            If address and port cannot be had.
        """
        family = socket.AF_INET6 if ":" in address else socket.AF_INET
        listening = socket.create_server((address, port), family=family)
        self.port = listening.getsockname()[1]
        site, ready = Site(address, self.port, self.world), threading.Event()
        run = lambda: asyncio.run(self._serve(listening, site, ready))  # noqa: E731, a thread's whole body
        self._thread = threading.Thread(target=run, name="page", daemon=True)
        self._thread.start()
        ready.wait(5.0)
        self._backstage.board.on_change = self._changed

    def stop(self) -> None:
        """Close all pages and the port."""
        self._backstage.board.on_change = lambda: None
        if self._loop is not None and self._done is not None:
            self._loop.call_soon_threadsafe(self._done.set)
        if self._thread is not None:
            self._thread.join(2 * _CLOSING)
        self._workers.shutdown(wait=False, cancel_futures=True)
        self._backstage.control.close()
        self.world.stop()

    def _changed(self) -> None:
        """The task has put something on the board: called in its thread, and must cost it nothing."""
        if self._loop is not None and self._sessions:
            self._loop.call_soon_threadsafe(self._wake_all)

    def _wake_all(self) -> None:
        for session in self._sessions:
            session.wake()

    async def _serve(self, listening: socket.socket, site: Site, ready: threading.Event) -> None:
        self._loop, self._done = asyncio.get_running_loop(), asyncio.Event()
        quiet = logging.getLogger("sonar_component.page")
        quiet.setLevel(logging.CRITICAL)  # every browser that closes early is a traceback there
        async with serve(
            self._talk,
            sock=listening,
            process_request=site.answer,
            select_subprotocol=_viser_protocol,
            close_timeout=_CLOSING,
            compression=None,  # images are noise, and deflate would take longer than drawing them
            max_size=_MAX_REQUEST,
            logger=quiet,
        ):
            ready.set()
            status = asyncio.create_task(self._tell_status())
            await self._done.wait()
            status.cancel()
        self._loop = None

    async def _talk(self, connection: ServerConnection) -> None:
        assert connection.request is not None
        if connection.request.path.partition("?")[0].rstrip("/") == WORLD:
            await self.world.join(connection)
            return
        session = Session(connection, self._backstage)
        self._sessions.add(session)
        try:
            await session.talk(self._status)
        finally:
            self._sessions.discard(session)

    async def _tell_status(self) -> None:
        while True:
            if self._sessions:
                try:
                    self._status = json.dumps(await self._backstage.work(self._look))
                except Exception:  # the page must go on when the graph does not answer
                    self._backstage.log.exception("status of the graph")
                for session in self._sessions:
                    session.tell(self._status)
            await asyncio.sleep(_STATUS_PERIOD)

    def _look(self) -> dict[str, Any]:
        """How every sonar's stream and every task is."""
        now, board = time.monotonic(), self._backstage.board
        with board.lock:
            sonars = {channel.source: channel.facts(now) for channel in board.channels.values()}
        tasks = self._backstage.control.status()
        return {"kind": "status", "sonars": sonars, "tasks": tasks, "pages": len(self._sessions)}


def _viser_protocol(connection: ServerConnection, offered: Any) -> Subprotocol | None:
    """The 3-D client names its version as a subprotocol; it is handed on as it is."""
    return next((Subprotocol(p) for p in offered if p.startswith("viser-v")), None)
