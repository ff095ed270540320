"""A pseudo-terminal as a serial line: clients open the link to its slave side as they would open /dev/ttyUSB0.

Nobody here keeps the slave open, so that a client's going is seen (the kernel says POLLHUP on the master) and what the
device says to nobody is lost, as on a wire. Keeping it open was the alternative: then replies to a client that left
pile up in the kernel and greet the next one. A break is invisible on a pseudo-terminal: see ``LineBreak`` in
ping_protocol.py.
"""

from __future__ import annotations

import contextlib
import os
import select
import termios
import tty
from collections.abc import Hashable
from pathlib import Path

from sonar_component.devices.link import Arrival, Kind, Peer

_LOOK_AGAIN = 0.02  # [s], between two looks whether somebody opened the line
_OWED_MAX = 1 << 16  # [bytes], what a client that does not read may owe us before whole messages are dropped


class PtyLink:
    """A pseudo-terminal with a name.

    Parameters
    ----------
    link : path
        Symbolic link to make; an old one is replaced, any other file is left alone.

    Raises
    ------
    OSError
        If the link cannot be made.
    """

    def __init__(self, link: str | Path) -> None:
        self._link = Path(link)
        self._master, slave = os.openpty()
        try:
            tty.setraw(slave)
            self._slave_name = os.ttyname(slave)
            os.set_blocking(self._master, False)
            self._make_link()
        except BaseException:
            os.close(self._master)
            raise
        finally:
            os.close(slave)  # from here on POLLHUP tells whether somebody has it open
        self._poll = select.poll()
        self._poll.register(self._master, select.POLLIN)
        self._open = False
        self._owed = bytearray()
        self.dropped = 0

    def _make_link(self) -> None:
        if self._link.is_symlink():
            self._link.unlink()
        os.symlink(self._slave_name, self._link)

    def describe(self) -> str:
        """``serial line LINK``."""
        return f"serial line {self._link}"

    def readable(self) -> list[int]:
        """The master, while somebody has the line open: a line that hung up is always ready to read."""
        return [self._master] if self._open else []

    def writable(self) -> list[int]:
        """The master, while it owes bytes."""
        return [self._master] if self._owed and self._open else []

    def look_again(self) -> float | None:
        """Soon: no descriptor tells that somebody opened the line."""
        return None if self._open else _LOOK_AGAIN

    def receive(self) -> list[Arrival]:
        """Bytes, and whether somebody opened or closed the line."""
        peer = Peer(self, None)
        found: list[Arrival] = []
        hung_up = bool(self._events() & select.POLLHUP)
        if not hung_up and not self._open:
            self._open = True
            found.append(Arrival(Kind.OPENED, peer))
        data = self._read()
        if data:
            found.append(Arrival(Kind.DATA, peer, data))
        if hung_up and self._open:
            self._open = False
            self._owed.clear()
            termios.tcflush(self._master, termios.TCIOFLUSH)
            found.append(Arrival(Kind.CLOSED, peer))
        return found

    def send(self, data: bytes, address: Hashable = None) -> bool:
        """Send; lost if nobody listens, dropped whole if the client does not read."""
        if not self._open:
            return False
        if len(self._owed) > _OWED_MAX:
            self.dropped += 1
            return False
        self._owed += data
        self.flush()
        return True

    def flush(self) -> None:
        """Write what is owed as far as the line takes it."""
        while self._owed:
            try:
                written = os.write(self._master, self._owed)
            except BlockingIOError:
                return
            except OSError:  # EIO: the client is gone
                self._owed.clear()
                return
            del self._owed[:written]

    def close(self) -> None:
        """Close the line and take its name away."""
        os.close(self._master)
        with contextlib.suppress(OSError):
            if os.readlink(self._link) == self._slave_name:
                self._link.unlink()

    def _events(self) -> int:
        return sum(event for _, event in self._poll.poll(0))

    def _read(self) -> bytes:
        try:
            return os.read(self._master, 65536)
        except OSError:  # nothing there, or EIO: nobody has it open
            return b""
