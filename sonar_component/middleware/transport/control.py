"""Questions to a process: one ROUTER, requests and answers as msgpack maps.

A request is [empty frame, map] as a REQ socket sends it: ``{"id": 1, "op": "get", "task": "fls", ...}``; the answer
has the same id and either ``result`` or ``error``.
"""

from __future__ import annotations

import itertools
import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

import msgpack
import zmq

from sonar_component.middleware.transport.keys import Guard
from sonar_component.middleware.transport.loop import Loop
from sonar_component.middleware.transport.monitor import FAILED, Monitor
from sonar_component.middleware.transport.rejections import Rejections, peer_of
from sonar_component.middleware.transport.sockets import MAX_REQUEST_BYTES, Socket, bind, open_socket

_log = logging.getLogger("transport")
Answer = Callable[[dict[str, Any]], Any]


class WrongRequestError(RuntimeError):
    """The other side knows no such name or does not take the value: whoever asked must ask otherwise."""


class ControlServer:
    """Answers requests; an answer may be a Future, which is waited for elsewhere.

    Attributes
    ----------
    rejected : messages that are no requests, and peers whose key is not allowed.
    """

    def __init__(
        self, context: zmq.Context[Any], endpoints: list[str], loop: Loop, answer: Answer, guard: Guard | None = None
    ) -> None:
        self._socket: Socket = open_socket(context, zmq.ROUTER, MAX_REQUEST_BYTES)
        if guard is not None:
            guard.serve(self._socket)
        for endpoint in endpoints:
            bind(self._socket, endpoint)
        self.fd = int(self._socket.getsockopt(zmq.FD))
        self._loop, self._answer = loop, answer
        self._lock = threading.Lock()
        self.rejected = Rejections("control")
        self._monitor = Monitor(self._socket, FAILED, self.rejected.add)
        loop.add(self)
        loop.add(self._monitor)

    def serve(self) -> None:
        """Take all requests that have come."""
        while True:
            with self._lock:
                if self._socket.closed:
                    return
                try:
                    frames = self._socket.recv_multipart(zmq.NOBLOCK, copy=False)
                except zmq.Again:
                    return
            self._request(frames)

    def close(self) -> None:
        """Close the socket."""
        with self._lock:
            self._monitor.close()
            self._socket.close()

    def _request(self, frames: list[zmq.Frame]) -> None:
        address = peer_of(frames[-1])
        if len(frames) != 3 or frames[1].bytes:
            return self.rejected.add(address, "request must be an empty frame and a map")
        try:
            request = msgpack.unpackb(frames[2].bytes, strict_map_key=True)
        except Exception:  # msgpack raises a dozen types for the same fact
            return self.rejected.add(address, "request is not msgpack")
        if not isinstance(request, dict) or not isinstance(request.get("op"), str):
            return self.rejected.add(address, "request has no op")
        peer, number = frames[0].bytes, request.get("id")
        try:
            result = self._answer(request)
        except Exception as error:
            return self._reply(peer, {"id": number, **_said(error)})
        if isinstance(result, Future):
            result.add_done_callback(lambda done: self._loop.call(lambda: self._finish(peer, number, done)))
            return None
        return self._reply(peer, {"id": number, "result": result})

    def _finish(self, peer: bytes, number: Any, done: Future[Any]) -> None:
        error = done.exception()
        if error is not None:
            self._reply(peer, {"id": number, **_said(error)})
        else:
            self._reply(peer, {"id": number, "result": done.result()})

    def _reply(self, peer: bytes, answer: dict[str, Any]) -> None:
        try:
            packed = msgpack.packb(answer, default=plain)
        except (TypeError, ValueError) as error:
            packed = msgpack.packb({"id": answer.get("id"), "error": f"the result cannot be sent: {error}"})
        with self._lock:
            if not self._socket.closed:
                try:
                    self._socket.send_multipart([peer, b"", packed], zmq.NOBLOCK)
                except zmq.ZMQError as error:
                    _log.warning("answer could not be sent: %s", error)
        self.serve_soon()

    def serve_soon(self) -> None:
        """Sending may have swallowed the sign of a new request."""
        self._loop.call(self.serve)


class ControlClient:
    """Asks one process; one request at a time, from one thread.

    Parameters
    ----------
    join : shows our key to a process of another host.
    """

    def __init__(self, context: zmq.Context[Any], endpoint: str, join: Callable[[Socket], None] | None = None) -> None:
        self._socket = open_socket(context, zmq.DEALER, MAX_REQUEST_BYTES << 4)
        self._refusal = ""
        self._monitor = None if join is None else Monitor(self._socket, FAILED, self._refused)
        if join is not None:
            join(self._socket)
        self._socket.connect(endpoint)
        self._numbers = itertools.count(1)

    def _refused(self, peer: str, reason: str) -> None:
        self._refusal = f" ({reason})"

    def ask(self, op: str, timeout: float = 2.0, **arguments: Any) -> Any:
        """Send a request and wait for its answer.

        Raises
        ------
        TimeoutError
            If none comes in time.
        RuntimeError
            If the other side refuses; the text is its reason. `WrongRequestError` where the request itself is wrong.
        """
        number = next(self._numbers)
        request = msgpack.packb({"id": number, "op": op, **arguments}, default=plain)
        self._socket.send_multipart([b"", request])
        deadline = time.monotonic() + timeout
        while (left := deadline - time.monotonic()) > 0:
            if not self._socket.poll(int(left * 1000) + 1):
                continue
            answer = msgpack.unpackb(self._socket.recv_multipart()[-1])
            if answer.get("id") != number:
                continue  # the answer to a question we gave up on
            if "error" in answer:
                raise (WrongRequestError if answer.get("wrong") else RuntimeError)(answer["error"])
            return answer.get("result")
        if self._monitor is not None:
            self._monitor.serve()
        raise TimeoutError(f"no answer to {op!r} within {timeout:.2g} s{self._refusal}")

    def close(self) -> None:
        """Close the socket."""
        if self._monitor is not None:
            self._monitor.close()
        self._socket.close()


def _said(error: BaseException) -> dict[str, Any]:
    text = str(error) or type(error).__name__
    return {"error": text, "wrong": True} if isinstance(error, ValueError) else {"error": text}


def plain(value: Any) -> Any:
    """For msgpack and JSON: numpy values, models and dataclasses as plain ones."""
    if hasattr(value, "model_dump"):
        return value.model_dump(mode="json")
    if hasattr(value, "tolist"):
        return value.tolist()
    if hasattr(value, "__dataclass_fields__"):
        return dict(vars(value))
    if isinstance(value, (set, frozenset, tuple)):
        return list(value)
    return str(value)
