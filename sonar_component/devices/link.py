"""What a device's head and a wire have in common: who speaks, what arrived, and addresses."""

from __future__ import annotations

import ipaddress
from collections.abc import Hashable
from dataclasses import dataclass
from enum import Enum
from typing import Protocol


class Kind(Enum):
    """What happened on a wire."""

    DATA = "data"
    BREAK = "break"  # the line was held low, which on UDP is an empty datagram
    OPENED = "opened"
    CLOSED = "closed"


@dataclass(frozen=True)
class Peer:
    """Somebody at the other end of a wire."""

    link: Link
    address: Hashable


@dataclass(frozen=True)
class Arrival:
    """Something came over a wire."""

    kind: Kind
    peer: Peer
    data: bytes = b""


Outgoing = tuple[Peer, bytes]


class Link(Protocol):
    """A wire; all of its methods return at once."""

    def describe(self) -> str:
        """Where clients find it, in words."""

    def readable(self) -> list[int]:
        """File descriptors to wait on for reading."""

    def writable(self) -> list[int]:
        """File descriptors to wait on for writing: those that owe somebody bytes."""

    def look_again(self) -> float | None:
        """Seconds after which ``receive`` is to be called although no descriptor was ready; None for never."""

    def receive(self) -> list[Arrival]:
        """What came since the last call."""

    def send(self, data: bytes, address: Hashable) -> bool:
        """Send a whole message or none of it; False if it was not taken."""

    def flush(self) -> None:
        """Send on what a peer could not take before."""

    def close(self) -> None:
        """Give everything back."""


def parse_address(text: str) -> tuple[str, int]:
    """``HOST:PORT`` to a pair.

    Raises
    ------
    ValueError
        If it is not an IPv4 address or ``localhost`` with a port of 0 to 65535.
    """
    host, colon, port = text.rpartition(":")
    if not colon or not port.isascii() or not port.isdigit() or int(port) > 65535:
        raise ValueError(f"must be HOST:PORT with a port of 0 to 65535, such as 127.0.0.1:12345, got {text!r}")
    host = "127.0.0.1" if host == "localhost" else host
    try:
        ipaddress.IPv4Address(host)
    except ValueError:
        raise ValueError(f"must begin with an IPv4 address or localhost, got {text!r}") from None
    return host, int(port)


def is_local(text: str) -> bool:
    """Whether an address ``HOST:PORT`` is this computer's own."""
    return ipaddress.IPv4Address(parse_address(text)[0]).is_loopback
