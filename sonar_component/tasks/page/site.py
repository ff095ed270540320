"""What the page's server answers to plain requests: the page's own files, the colour maps, the 3-D client.

A request must name this server in its Host, and a socket come from a page of this server (Origin): else any web page
that the user has open could steer the sonar through the user's own browser. A server that is meant for other computers
cannot know its own names; it asks only that Origin and Host agree.
"""

from __future__ import annotations

import http
import json
from functools import cache
from pathlib import Path

from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from sonar_component.pictures.colours import COLOUR_MAPS, NO_DATA, colour_table
from sonar_component.tasks.page import LOOPBACK
from sonar_component.tasks.page.world import WORLD, World

_STATIC = Path(__file__).parent / "static"
_TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
_OK, _NOT_FOUND, _FORBIDDEN = http.HTTPStatus.OK, http.HTTPStatus.NOT_FOUND, http.HTTPStatus.FORBIDDEN


class Site:
    """Answers GET requests.

    Parameters
    ----------
    address, port : str, int
        Where the server listens.
    """

    def __init__(self, address: str, port: int, world: World) -> None:
        self._world = world
        known = {f"{_in_url(name)}:{port}" for name in LOOPBACK}
        self._hosts = known if address in LOOPBACK else None

    def answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """The answer to a request; None lets a WebSocket open."""
        host = request.headers.get("Host", "")
        if self._hosts is not None and host not in self._hosts:
            return _response(_FORBIDDEN, "this server is known by another name\n")
        path = request.path.partition("?")[0]
        if "websocket" in request.headers.get("Upgrade", "").lower():
            origin = request.headers.get("Origin", "").partition("://")[2]
            allowed = not origin or origin in (self._hosts or {host})
            return None if allowed else _response(_FORBIDDEN, "the page that asks is not of this server\n")
        if path == WORLD:
            return _response(http.HTTPStatus.MOVED_PERMANENTLY, "", {"Location": WORLD + "/"})
        if path == WORLD + "/":
            return self._client_of_world()
        if path == "/colours.json":
            return _response(_OK, _colours(), {"Content-Type": "application/json"})
        return _file("index.html" if path == "/" else path[1:])

    def _client_of_world(self) -> Response:
        try:
            return _response(_OK, self._world.page(), {"Content-Type": "text/html"})
        except (ImportError, OSError) as error:
            return _response(_NOT_FOUND, f"no 3-D world: {error}\n")


def _file(name: str) -> Response:
    # A name out of a fixed folder's own listing: no path of a request is ever opened.
    found = next((file for file in _STATIC.iterdir() if file.name == name), None)
    if found is None:
        return _response(_NOT_FOUND, f"no page {name!r} here\n")
    kind = _TYPES.get(found.suffix, "application/octet-stream")
    return _response(_OK, found.read_bytes(), {"Content-Type": f"{kind}; charset=utf-8"})


@cache
def _colours() -> str:
    """The colour maps of the pictures, so that page and files show the same."""
    return json.dumps({"maps": {name: colour_table(name).tolist() for name in COLOUR_MAPS}, "no_data": NO_DATA})


def _response(status: http.HTTPStatus, body: str | bytes, headers: dict[str, str] | None = None) -> Response:
    content = body.encode() if isinstance(body, str) else body
    fields = {"Content-Type": "text/plain; charset=utf-8", "Content-Length": str(len(content))}
    fields |= {"Cache-Control": "no-cache", "X-Content-Type-Options": "nosniff", **(headers or {})}
    return Response(status, status.phrase, Headers(**fields), content)


def _in_url(address: str) -> str:
    return f"[{address}]" if ":" in address else address
