"""How a scanning sonar on Ethernet is found: its adapter answers the text ``Discovery`` on a UDP port of its own."""

from __future__ import annotations

DISCOVERY_PORT = 30303
_REQUEST = b"Discovery"
_MAC = "02-50-33-36-30-01"  # locally administered, so that it is nobody's


def answer(request: bytes, address: str) -> bytes | None:
    """What the adapter says to a datagram, or None.

    Parameters
    ----------
    address : str
        Its own IPv4 address. A request to change it (``SetSS1IP``) has no answer, and is not obeyed.

    Returns
    -------
    bytes or None
        Four lines; clients want zeros in front of the octets and a line end after the last one.
    """
    if request.strip() != _REQUEST:
        return None
    octets = ".".join(f"{int(octet):03d}" for octet in address.split("."))
    lines = ("SONAR PING360  ", "Blue Robotics", f"MAC Address:- {_MAC}", f"IP Address:- {octets}", "")
    return "\r\n".join(lines).encode()
