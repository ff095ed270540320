"""Serves the page, its images and its controls on one port, to any number of browsers.

Decisions
* Built on websockets (kept, BSD, 1.6 MB, nothing to compile), which viser stands on too. viser itself draws the 3-D
  world (see world.py), but not the sonar: it shows images as JPEG or PNG encoded in Python for every frame, has no
  cursor over them, and one panel of widgets beside them, while a fan wants rings, ticks and the value under the
  pointer. NiceGUI (FastAPI and socket.io, 40 packages) and Panel or Dash (Tornado or Flask with a plotting client) were
  looked at: heavier, and a redraw goes through the server. rerun is a 100 MB viewer without controls; Foxglove's
  client is not in its wheel. So the page is plain HTML and JavaScript in this package: no build step, no download.
* Each browser has two images on the way at most, and is sent the newest one when it says that it drew one. So a slow
  page sees fewer images, never older ones, and a page that hangs costs two images of memory.
* A request must name this server in its Host, and a socket come from a page of this server (Origin): else any web page
  that the user has open could steer the sonar through the user's own browser.
"""

from __future__ import annotations

import asyncio
import http
import json
import logging
import socket
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.typing import Subprotocol

from sonar_component.pictures.colours import COLOUR_MAPS, NO_DATA, colour_table
from sonar_component.samples import Sonar
from sonar_component.tasks.page.board import Board, Channel
from sonar_component.tasks.page.stream import pack, pack_camera, pack_image
from sonar_component.tasks.page.world import WORLD, World

_STATIC = Path(__file__).parent / "static"
_TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
_IN_FLIGHT = 2  # [-] images: one being drawn, one on the way
_STATUS_PERIOD = 0.5  # [s]
_CLOSING = 0.3  # [s], for browsers to say goodbye: a task that stops is given 1.5 s in all
_MAX_REQUEST = 64 * 1024  # bytes, of a message from a page; the largest is a list of bearings
_LOOPBACK = ("127.0.0.1", "localhost", "[::1]")


class Control(Protocol):
    """What the page may ask of the graph."""

    def status(self) -> list[dict[str, Any]]:
        """Every task: name, type, state, substate, reason, properties with value, and which of them can change now."""

    def set(self, task: str, name: str, value: Any) -> Any:
        """Set a property and return its new value; ValueError with the reason if it is refused."""

    def close(self) -> None:
        """Give back what asking took."""


@dataclass(eq=False)
class Session:
    """One browser: what it was sent and how much it may still be sent.

    Attributes
    ----------
    credit : images that may still be sent before the page has drawn one.
    sent, times, shown : per sonar the version, the data time [us] and the image that were sent last.
    paused, steps : sonars that stand still, and those of them that shall show one more image.
    status : a status message not sent yet.
    """

    socket: ServerConnection
    credit: int = _IN_FLIGHT
    sent: dict[str, int] = field(default_factory=dict)
    shown: dict[str, Sonar] = field(default_factory=dict)
    visible: bool = True
    paused: set[str] = field(default_factory=set)
    steps: set[str] = field(default_factory=set)
    status: str = ""
    times: dict[str, int] = field(default_factory=dict)
    wake: asyncio.Event = field(default_factory=asyncio.Event)


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
        self._board, self._control, self._now, self._files, self.world = board, control, now, files, world
        self._log = log
        self._sessions: set[Session] = set()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None
        self._done: asyncio.Event | None = None
        self._workers = ThreadPoolExecutor(2, thread_name_prefix="page")
        self._status: dict[str, Any] = {"kind": "status", "sonars": {}, "tasks": []}
        self._hosts: set[str] = set()
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
        self._hosts = {f"{name}:{self.port}" for name in (*_LOOPBACK, address, f"[{address}]")}
        ready = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(listening, ready), name="page", daemon=True)
        self._thread.start()
        ready.wait(5.0)
        self._board.on_change = self._changed

    def stop(self) -> None:
        """Close all pages and the port."""
        self._board.on_change = lambda: None
        if self._loop is not None and self._done is not None:
            self._loop.call_soon_threadsafe(self._done.set)
        if self._thread is not None:
            self._thread.join(2 * _CLOSING)
        self._workers.shutdown(wait=False, cancel_futures=True)
        self._control.close()
        self.world.stop()

    def _changed(self) -> None:
        if self._loop is not None and self._sessions:
            self._loop.call_soon_threadsafe(self._wake_all)

    def _wake_all(self) -> None:
        for session in self._sessions:
            session.wake.set()

    def _run(self, listening: socket.socket, ready: threading.Event) -> None:
        asyncio.run(self._serve(listening, ready))

    async def _serve(self, listening: socket.socket, ready: threading.Event) -> None:
        self._loop, self._done = asyncio.get_running_loop(), asyncio.Event()
        quiet = logging.getLogger("sonar_component.page")
        quiet.setLevel(logging.CRITICAL)  # every browser that closes early is a traceback there
        async with serve(
            self._talk,
            sock=listening,
            process_request=self._answer,
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

    # HTTP

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        if request.headers.get("Host", "") not in self._hosts:
            return _response(http.HTTPStatus.FORBIDDEN, "this server is known by another name\n")
        path = request.path.partition("?")[0]
        if "websocket" in request.headers.get("Upgrade", "").lower():
            origin = request.headers.get("Origin", "")
            if origin and origin.partition("://")[2] not in self._hosts:
                return _response(http.HTTPStatus.FORBIDDEN, "the page that asks is not of this server\n")
            return None
        if path == WORLD:
            return _response(http.HTTPStatus.MOVED_PERMANENTLY, "", {"Location": WORLD + "/"})
        if path == WORLD + "/":
            try:
                return _response(http.HTTPStatus.OK, self.world.page(), {"Content-Type": "text/html"})
            except (ImportError, OSError) as error:
                return _response(http.HTTPStatus.NOT_FOUND, f"no 3-D world: {error}\n")
        if path == "/colours.json":
            return _response(http.HTTPStatus.OK, _colours(), {"Content-Type": "application/json"})
        return self._static("index.html" if path == "/" else path[1:])

    def _static(self, name: str) -> Response:
        # A name from a fixed folder, compared with the folder's own listing: no path of the request is ever opened.
        found = next((file for file in _STATIC.iterdir() if file.name == name), None)
        if found is None:
            return _response(http.HTTPStatus.NOT_FOUND, f"no page {name!r} here\n")
        kind = _TYPES.get(found.suffix, "application/octet-stream")
        return _response(http.HTTPStatus.OK, found.read_bytes(), {"Content-Type": f"{kind}; charset=utf-8"})

    # One browser

    async def _talk(self, connection: ServerConnection) -> None:
        assert connection.request is not None
        if connection.request.path.partition("?")[0].rstrip("/") == WORLD:
            await self.world.join(connection)
            return
        session = Session(connection)
        self._sessions.add(session)
        session.wake.set()
        sender = asyncio.create_task(self._send_images(session))
        try:
            await connection.send(json.dumps(self._status))
            async for message in connection:
                await self._hear(session, message)
        except ConnectionClosed:
            pass
        finally:
            self._sessions.discard(session)
            sender.cancel()

    async def _send_images(self, session: Session) -> None:
        try:
            while True:
                await session.wake.wait()
                session.wake.clear()
                status, session.status = session.status, ""
                if status:
                    await session.socket.send(status)
                for message in self._news(session):
                    await session.socket.send(message)
        except ConnectionClosed:
            pass

    def _news(self, session: Session) -> list[bytes]:
        """Messages for what changed since the session was last sent something, as far as its credit goes."""
        if not session.visible:
            return []
        with self._board.lock:
            # Longest unseen first, so that with little credit every sonar has its turn.
            waiting = sorted(self._board.channels.values(), key=lambda c: session.sent.get(c.source, -1) - c.version)
            wanted = [channel for channel in waiting if _wants(session, channel)][: session.credit]
            found = [self._image(session, channel) for channel in wanted]
            camera, version = self._board.camera, self._board.camera_version
        if camera is not None and session.credit > 0 and version > session.sent.get("", 0):
            session.credit -= 1
            session.sent[""] = version
            found.append(pack_camera(camera, version, self._age(camera.time)))
        return found

    def _image(self, session: Session, channel: Channel) -> bytes:
        source, sonar = channel.source, channel.latest
        assert sonar is not None
        since = session.sent.get(source, -1)
        session.credit -= 1
        session.sent[source], session.times[source] = channel.version, sonar.time
        if channel.sweep is None:
            session.shown[source] = sonar
        elif source in session.paused:  # a turn is copied (4 MB) only where it shall stand still
            session.shown[source] = channel.picture()
        session.steps.discard(source)
        return pack_image(channel, since, self._age(sonar.time))

    def _age(self, time: int) -> float | None:
        return (self._now() - time) * 1e-6 if time else None

    async def _hear(self, session: Session, message: str | bytes) -> None:
        """One message from a page; what is not understood is answered, never raised."""
        try:
            request = json.loads(message)
            kind = request["kind"]
        except (ValueError, TypeError, KeyError):
            return
        if kind == "drawn":
            session.credit = min(session.credit + 1, _IN_FLIGHT)
            source = str(request.get("source", ""))
            if source in session.times:
                age = self._age(session.times[source])
                await session.socket.send(json.dumps({"kind": "age", "source": source, "age": age}))
            session.wake.set()
        elif kind == "visible":
            session.visible = bool(request.get("visible"))
            session.wake.set()
        elif kind in ("pause", "step", "go"):
            self._pause(session, kind, str(request.get("source", "")))
        elif kind == "set":
            await self._set(session, request)
        elif kind == "save":
            await self._save(session, request)

    def _pause(self, session: Session, kind: str, source: str) -> None:
        with self._board.lock:
            channel = self._board.channels.get(source)
            if channel is None:
                return
            if kind == "go":
                session.paused.discard(source)
            else:
                session.paused.add(source)
                if channel.sweep is not None:
                    session.shown[source] = channel.picture()
            if kind == "step":
                session.steps.add(source)
        session.wake.set()

    async def _set(self, session: Session, request: dict[str, Any]) -> None:
        task, name, value = str(request.get("task")), str(request.get("name")), request.get("value")
        reply: dict[str, Any] = {"kind": "set", "task": task, "name": name}
        try:
            reply["value"] = await self._work(self._control.set, task, name, value)
            self._log.info("%s.%s set to %r from the page", task, name, value)
        except (ValueError, OSError) as error:
            reply["refused"] = str(error)
            self._log.warning("%s.%s not set to %r from the page: %s", task, name, value, error)
        await session.socket.send(json.dumps(reply))

    async def _save(self, session: Session, request: dict[str, Any]) -> None:
        source = str(request.get("source"))
        with self._board.lock:
            channel = self._board.channels.get(source)
            turning = channel is not None and channel.sweep is not None and source not in session.paused
            shown = channel.picture() if channel is not None and turning else session.shown.get(source)
        try:
            if shown is None:
                raise ValueError("no image to save yet")
            name, content = await self._work(self._files, request, shown)
        except (ValueError, OSError) as error:
            await session.socket.send(json.dumps({"kind": "notice", "text": f"not saved: {error}"}))
            return
        await session.socket.send(pack({"kind": "file", "name": name}, {"content": np.frombuffer(content, np.uint8)}))

    async def _work(self, function: Callable[..., Any], *arguments: Any) -> Any:
        return await asyncio.get_running_loop().run_in_executor(self._workers, function, *arguments)

    # Everybody

    async def _tell_status(self) -> None:
        while True:
            if self._sessions:
                try:
                    self._status = await self._work(self._look)
                except Exception:  # the page must go on when the graph does not answer
                    self._log.exception("status of the graph")
                text = json.dumps(self._status)
                for session in self._sessions:
                    session.status = text
                    session.wake.set()
            await asyncio.sleep(_STATUS_PERIOD)

    def _look(self) -> dict[str, Any]:
        now = time.monotonic()
        with self._board.lock:
            sonars = {
                c.source: {
                    "rate": round(c.rate(now), 2),
                    "since": round(now - c.arrivals[-1], 2) if c.arrivals else None,
                    "dropped": c.dropped,
                    "lost": c.lost,
                    "invalid": c.invalid,
                    "notice": c.notice if now - c.noticed < 10.0 else "",
                }
                for c in self._board.channels.values()
            }
        return {"kind": "status", "sonars": sonars, "tasks": self._control.status(), "pages": len(self._sessions)}


def _wants(session: Session, channel: Channel) -> bool:
    source = channel.source
    if channel.latest is None or (source in session.paused and source not in session.steps):
        return False
    return channel.version > session.sent.get(source, -1)


def _viser_protocol(connection: ServerConnection, offered: Any) -> Subprotocol | None:
    """The 3-D client names its version as a subprotocol; it is handed on as it is."""
    return next((Subprotocol(p) for p in offered if p.startswith("viser-v")), None)


@cache
def _colours() -> str:
    """The colour maps of the pictures, so that page and files show the same."""
    return json.dumps({"maps": {name: colour_table(name).tolist() for name in COLOUR_MAPS}, "no_data": NO_DATA})


def _response(status: http.HTTPStatus, body: str | bytes, headers: dict[str, str] | None = None) -> Response:
    content = body.encode() if isinstance(body, str) else body
    fields = {"Content-Type": "text/plain; charset=utf-8", "Content-Length": str(len(content))}
    fields |= {"Cache-Control": "no-cache", "X-Content-Type-Options": "nosniff", **(headers or {})}
    return Response(status, status.phrase, Headers(**fields), content)
