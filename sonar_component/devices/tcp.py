"""A TCP server for one client at a time, as the device has it: a second one is turned away.

Messages leave whole or not at all, since clients of such streams do not find their way back after half a message: what
a slow client has not taken is kept, and further messages are dropped until it is gone.
"""

from __future__ import annotations

import contextlib
import socket
import time
from collections.abc import Callable, Hashable
from typing import cast

from sonar_component.devices.link import Arrival, Kind, Peer, parse_address

_STUCK = 10.0  # [s], after which a client that takes nothing is let go
_AT_ONCE = 1 << 18  # [bytes], read before the device gets its turn
_WAITING = 128  # [-], clients in the kernel: one more waits for a second until it tries again
_TURNED_AWAY_AT_ONCE = 64  # [-], clients, before the device gets its turn


class TcpServer:
    """A listening socket and its client.

    Raises
    ------
    OSError
        If the address cannot be had.
    """

    def __init__(self, address: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._listener = socket.create_server(parse_address(address), backlog=_WAITING)
        self._listener.setblocking(False)
        self._clock = clock
        self._client: socket.socket | None = None
        self._address: Hashable = None
        self._owed = memoryview(b"")
        self._last_progress = 0.0
        self.dropped = self.turned_away = 0

    @property
    def port(self) -> int:
        """TCP port in use."""
        return cast(int, self._listener.getsockname()[1])

    def describe(self) -> str:
        """``tcp HOST:PORT``."""
        return "tcp {}:{}".format(*self._listener.getsockname())

    def readable(self) -> list[int]:
        """Listener and client."""
        return [self._listener.fileno()] + ([self._client.fileno()] if self._client else [])

    def writable(self) -> list[int]:
        """The client, while it is owed bytes."""
        return [self._client.fileno()] if self._client and self._owed else []

    def look_again(self) -> float | None:
        """Now and then while a client is owed bytes, to let go of one that is stuck."""
        return 1.0 if self._owed else None

    def receive(self) -> list[Arrival]:
        """Bytes, and clients that come and go."""
        found = self._read()
        for _ in range(_TURNED_AWAY_AT_ONCE):
            try:
                client, address = self._listener.accept()
            except OSError:  # nobody else waits, or somebody who waited has gone
                break
            if self._client is not None:
                self.turned_away += 1
                client.close()
                continue
            client.setblocking(False)
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            client.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)  # one that vanished must not hold the place
            self._client, self._address, self._owed = client, address, memoryview(b"")
            found.append(Arrival(Kind.OPENED, self._peer()))
            found += self._read()
        return found

    def send(self, data: bytes, address: Hashable) -> bool:
        """Send a whole message, or drop it while the client still owes us its attention."""
        if self._client is None or address != self._address:
            return False
        if self._owed:
            self.dropped += 1
            return False
        self._owed, self._last_progress = memoryview(data), self._clock()
        self.flush()
        return True

    def flush(self) -> None:
        """Send on what the client has not taken."""
        while self._client is not None and self._owed:
            try:
                sent = self._client.send(self._owed)
            except BlockingIOError:
                return
            except OSError:
                self._owed = memoryview(b"")  # gone; receive() says so
                return
            self._owed, self._last_progress = self._owed[sent:], self._clock()

    def close(self) -> None:
        """Close client and listener."""
        self._let_go()
        self._listener.close()

    def _peer(self) -> Peer:
        return Peer(self, self._address)

    def _read(self) -> list[Arrival]:
        if self._client is None:
            return []
        peer, data, gone = self._peer(), b"", False
        try:
            data = self._client.recv(_AT_ONCE)
            gone = not data
        except BlockingIOError:
            gone = bool(self._owed) and self._clock() - self._last_progress > _STUCK
        except OSError:
            gone = True
        found = [Arrival(Kind.DATA, peer, data)] if data else []
        if gone:
            self._let_go()
            found.append(Arrival(Kind.CLOSED, peer))
        return found

    def _let_go(self) -> None:
        if self._client is not None:
            with contextlib.suppress(OSError):
                self._client.close()
        self._client, self._owed = None, memoryview(b"")
