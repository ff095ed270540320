"""One browser: what it was sent, how much it may still be sent, and what it asks for.

Decision: a browser has two images on the way at most, and is sent the newest one when it says that it drew one. So a
slow page sees fewer images, never older ones, and a page that hangs costs two images of memory. Sending every image and
letting TCP push back was the alternative: kernel buffers then hold seconds of old images for a slow page.
"""

from __future__ import annotations

import asyncio
import json
import logging
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from sonar_component.samples import Sonar
from sonar_component.tasks.page.board import Board, Channel
from sonar_component.tasks.page.stream import pack, pack_camera, pack_image

_IN_FLIGHT = 2  # [-] images: one being drawn, one on the way
_LOGGED = 200  # [-] characters of what a page sent: a line of a log is no place for 64 kB
_CAMERA = ""  # stands for the camera among the names of sonars


class Control(Protocol):
    """What a page may ask of the graph."""

    def status(self) -> list[dict[str, Any]]:
        """Every task: name, type, state, substate, reason, properties with value, and which of them can change now."""

    def set(self, task: str, name: str, value: Any) -> Any:
        """Set a property and return its new value; ValueError with the reason if it is refused.

        TimeoutError if the task does not answer in time; it may set it yet.
        """

    def close(self) -> None:
        """Give back what asking took."""


@dataclass(frozen=True)
class Backstage:
    """What all browsers share.

    Attributes
    ----------
    now : data time [us], to tell how old an image is.
    files : (request, image) -> (file name, content), for what a page saves.
    workers : for what takes longer than a page should wait for others.
    """

    board: Board
    control: Control
    now: Callable[[], int]
    files: Callable[[dict[str, Any], Sonar], tuple[str, bytes]]
    workers: Executor
    log: logging.Logger

    def age(self, time: int) -> float | None:
        """Of something true at ``time`` [us], in seconds; None if that is not known."""
        return (self.now() - time) * 1e-6 if time else None

    async def work(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Run a function in a worker thread."""
        return await asyncio.get_running_loop().run_in_executor(self.workers, function, *arguments)


class Session:
    """The conversation with one browser; lives in the server's event loop."""

    def __init__(self, socket: ServerConnection, backstage: Backstage) -> None:
        self._socket, self._backstage = socket, backstage
        self._credit = _IN_FLIGHT
        self._visible = True
        self._status = ""
        self._sent: dict[str, int] = {}  # version of each sonar's picture
        self._times: dict[str, int] = {}  # data time [us] of the same
        self._shown: dict[str, Sonar] = {}
        self._paused: set[str] = set()
        self._steps: set[str] = set()  # paused sonars that shall show one more image
        self._wake = asyncio.Event()

    def wake(self) -> None:
        """Something new may be there to be sent."""
        self._wake.set()

    def tell(self, status: str) -> None:
        """Send a status as soon as the browser takes it; an older one that still waits is left out."""
        self._status = status
        self._wake.set()

    async def talk(self, greeting: str) -> None:
        """Send and listen until the browser is gone."""
        self.tell(greeting)
        sender = asyncio.create_task(self._send())
        try:
            async for message in self._socket:
                await self._hear(message)
        except ConnectionClosed:
            pass
        finally:
            sender.cancel()

    async def _send(self) -> None:
        try:
            while True:
                await self._wake.wait()
                self._wake.clear()
                status, self._status = self._status, ""
                if status:
                    await self._socket.send(status)
                for message in self._news():
                    await self._socket.send(message)
        except ConnectionClosed:
            pass

    def _news(self) -> list[bytes]:
        """Messages for what changed since the last ones, as far as the credit goes."""
        if not self._visible:
            return []
        board = self._backstage.board
        with board.lock:
            # Longest unseen first, so that with little credit every sonar has its turn.
            waiting = sorted(board.channels.values(), key=lambda c: self._sent.get(c.source, -1) - c.version)
            found = [self._image(channel) for channel in [c for c in waiting if self._wants(c)][: self._credit]]
            camera, version = board.camera, board.camera_version
        if camera is not None and self._credit > 0 and version > self._sent.get(_CAMERA, 0):
            self._credit -= 1
            self._sent[_CAMERA] = version
            found.append(pack_camera(camera, version, self._backstage.age(camera.time)))
        return found

    def _wants(self, channel: Channel) -> bool:
        source = channel.source
        if channel.latest is None or (source in self._paused and source not in self._steps):
            return False
        return channel.version > self._sent.get(source, -1)

    def _image(self, channel: Channel) -> bytes:
        source, sonar = channel.source, channel.latest
        assert sonar is not None
        since = self._sent.get(source, -1)
        self._credit -= 1
        self._sent[source], self._times[source] = channel.version, sonar.time
        if channel.sweep is None:
            self._shown[source] = sonar
        elif source in self._paused:  # a turn is copied (4 MB) only where it shall stand still
            self._shown[source] = channel.picture()
        self._steps.discard(source)
        return pack_image(channel, since, self._backstage.age(sonar.time))

    async def _hear(self, message: str | bytes) -> None:
        """One message from the page; what is not understood is passed over."""
        try:
            request = json.loads(message)
            kind, source = request["kind"], str(request.get("source", ""))
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError):  # the last: lists 5000 deep
            return
        if kind == "drawn":
            await self._drawn(source)
        elif kind == "visible":
            self._visible = bool(request.get("visible"))
        elif kind in ("pause", "step", "go"):
            self._pause(kind, source)
        elif kind == "set":
            await self._set(str(request.get("task")), str(request.get("name")), request.get("value"))
        elif kind == "save":
            await self._save(request, source)
        self._wake.set()

    async def _drawn(self, source: str) -> None:
        self._credit = min(self._credit + 1, _IN_FLIGHT)
        if source in self._times:
            age = self._backstage.age(self._times[source])
            await self._say({"kind": "age", "source": source, "age": age})

    def _pause(self, kind: str, source: str) -> None:
        with self._backstage.board.lock:
            channel = self._backstage.board.channels.get(source)
            if channel is None:
                return
            if kind == "go":
                self._paused.discard(source)
                return
            self._paused.add(source)
            if channel.sweep is not None:
                self._shown[source] = channel.picture()
            if kind == "step":
                self._steps.add(source)

    async def _set(self, task: str, name: str, value: Any) -> None:
        log, reply = self._backstage.log, {"kind": "set", "task": task, "name": name}
        what = f"{task}.{name} = {value!r}"[:_LOGGED]
        try:
            reply["value"] = await self._backstage.work(self._backstage.control.set, task, name, value)
            log.info("set from the page: %s", what)
        except TimeoutError as error:
            reply["unanswered"] = f"{error}: the task is busy, and sets it when it has time"
            log.warning("no answer to what the page sets: %s: %s", what, error)
        except (ValueError, OSError, OverflowError) as error:  # the last: a whole number that fits no message
            reply["refused"] = str(error)
            log.warning("not set from the page: %s: %s", what, str(error)[:_LOGGED])
        await self._say(reply)

    async def _save(self, request: dict[str, Any], source: str) -> None:
        with self._backstage.board.lock:
            channel = self._backstage.board.channels.get(source)
            turning = channel is not None and channel.sweep is not None and source not in self._paused
            shown = channel.picture() if channel is not None and turning else self._shown.get(source)
        try:
            if shown is None:
                raise ValueError("no image to save yet")
            name, content = await self._backstage.work(self._backstage.files, request, shown)
        except (ValueError, OSError) as error:
            await self._say({"kind": "notice", "text": f"not saved: {error}"})
            return
        await self._socket.send(pack({"kind": "file", "name": name}, {"content": np.frombuffer(content, np.uint8)}))

    async def _say(self, message: dict[str, Any]) -> None:
        await self._socket.send(json.dumps(message))
