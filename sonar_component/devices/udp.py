"""A UDP socket as a device's wire: each sender is a peer, and an empty datagram is a line break."""

from __future__ import annotations

import socket
from collections.abc import Hashable
from typing import cast

from sonar_component.devices.link import Arrival, Kind, Peer, parse_address

_AT_ONCE = 64  # [datagrams], taken before the device gets its turn: a flood must not stop the clock


class UdpLink:
    """A bound socket.

    Raises
    ------
    OSError
        If the address cannot be had.
    """

    def __init__(self, address: str) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind(parse_address(address))
        except OSError:
            self._socket.close()
            raise
        self._socket.setblocking(False)

    @property
    def port(self) -> int:
        """UDP port in use."""
        return cast(int, self._socket.getsockname()[1])

    def describe(self) -> str:
        """``udp HOST:PORT``."""
        return "udp {}:{}".format(*self._socket.getsockname())

    def address_towards(self, peer: Hashable) -> str:
        """Our own IPv4 address as a peer sees it, also where the socket is bound to all of them."""
        host = cast(str, self._socket.getsockname()[0])
        if host != "0.0.0.0":
            return host
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.connect(cast("tuple[str, int]", peer))  # sends nothing: it only chooses a route
            return cast(str, probe.getsockname()[0])

    def readable(self) -> list[int]:
        """The socket."""
        return [self._socket.fileno()]

    def writable(self) -> list[int]:
        """None: a datagram is sent or lost."""
        return []

    def look_again(self) -> float | None:
        """Never."""
        return None

    def receive(self) -> list[Arrival]:
        """Waiting datagrams."""
        found: list[Arrival] = []
        while len(found) < _AT_ONCE:
            try:
                data, address = self._socket.recvfrom(65536)
            except BlockingIOError:
                break
            except OSError:  # a client that went away makes the next call fail once
                continue
            found.append(Arrival(Kind.DATA if data else Kind.BREAK, Peer(self, address), data))
        return found

    def send(self, data: bytes, address: Hashable) -> bool:
        """One datagram."""
        try:
            self._socket.sendto(data, cast("tuple[str, int]", address))
        except OSError:
            return False
        return True

    def flush(self) -> None:
        """Nothing is ever owed."""

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
