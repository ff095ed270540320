"""What tests of heads need: a peer without a wire, and a hand that turns the clock."""

from __future__ import annotations

from typing import Any

import numpy as np

from sonar_component.devices.echoes import PingOrder
from sonar_component.devices.link import Arrival, Kind, Outgoing, Peer
from sonar_component.samples import Sonar


class NoLink:
    """Stands for a wire that nothing is sent over."""


LINK: Any = NoLink()
CLIENT, OTHER = Peer(LINK, ("127.0.0.1", 5001)), Peer(LINK, ("127.0.0.1", 5002))
SERIAL = Peer(LINK, None)


class Bench:
    """Drives a head as a station does, with a clock of its own: pings are ready at once and leave when due.

    Attributes
    ----------
    sent : (time, peer, bytes) of everything that left.
    orders : every ping that was begun.
    """

    def __init__(self, head: Any) -> None:
        self.head, self.now = head, 100.0
        self.sent: list[tuple[float, Peer, bytes]] = []
        self.orders: list[PingOrder] = []

    def say(self, data: bytes, peer: Peer = CLIENT, kind: Kind = Kind.DATA) -> list[bytes]:
        """Bytes of a client; what was answered at once."""
        before = len(self.sent)
        self._note(self.head.receive(Arrival(kind, peer, data), self.now))
        return [data for _, _, data in self.sent[before:]]

    def run(self, seconds: float) -> None:
        """Let time pass."""
        end = self.now + seconds
        while self.now < end:
            order = self.head.begin(self.now)
            if order is not None:
                self.orders.append(order)
            current = self.head.order
            until = min(self.head.next_tick(), current.due if current is not None else end, end)
            self.now = max(self.now, until)
            self._note(self.head.tick(self.now))
            if current is not None and current is self.head.order and self.now >= current.due:
                self._note(self.head.finish(echoes(current), self.now))

    def _note(self, outgoing: list[Outgoing]) -> None:
        self.sent += [(self.now, peer, data) for peer, data in outgoing]


def echoes(order: PingOrder) -> Sonar:
    """A ramp over the bins, the same in every beam."""
    s = order.settings
    beams = getattr(s, "beam_count", 1)
    bins = np.tile(np.linspace(0, 1, s.bin_count, dtype=np.float32), (beams, 1))
    return Sonar(bins=bins, bin_count=s.bin_count, beam_count=beams)
