"""A device at work: one thread that serves its links, keeps its clock and never sends echoes before they are due.

Replies leave at or after their time; where the picture is late they leave late, and are never left out.
"""

from __future__ import annotations

import contextlib
import logging
import os
import select
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from sonar_component.devices.echoes import EchoSource, Imager, PingOrder
from sonar_component.devices.link import Arrival, Link, Outgoing
from sonar_component.samples import Sonar
from sonar_component.sonars.settings import SonarSettings

LATE = 1e-3  # [s], after its time a reply counts as late: a fifth of the interval at which clients poll
_REMEMBERED = 1 << 16  # [pings] whose lateness is kept
_IDLE = 0.5  # [s], longest wait


class Head(Protocol):
    """What a device does, without I/O; times are monotonic seconds that the caller gives.

    Attributes
    ----------
    order : PingOrder or None
        The ping in progress; another one, or None, once a client has changed its mind.
    """

    order: PingOrder | None

    def settings(self) -> SonarSettings:
        """Settings of a ping right after power-up."""

    def begin(self, now: float) -> PingOrder | None:
        """Begin the next ping if there is none in progress and one is wanted."""

    def finish(self, sample: Sonar, now: float) -> list[Outgoing]:
        """The ping in progress has its echoes and is due: what the device says."""

    def tick(self, now: float) -> list[Outgoing]:
        """What the device says by itself at this time."""

    def next_tick(self) -> float:
        """When ``tick`` is wanted again, or a ping may begin; infinity for never."""


@dataclass
class Timing:
    """How punctual a device was.

    Attributes
    ----------
    pings : int
        Echoes sent.
    late : int
        Of these, later than 1 ms.
    unsent : int
        Messages that a client was too slow to take.
    failed : int
        Pings that could not be rendered and were sent empty.
    lateness_p50, lateness_p99, lateness_max : float
        Of the last 65536 [s]; never below 0.
    """

    pings: int = 0
    late: int = 0
    unsent: int = 0
    failed: int = 0
    lateness_p50: float = 0.0
    lateness_p99: float = 0.0
    lateness_max: float = 0.0


Listener = Callable[[Sonar, list[Outgoing]], None]
Wire = tuple[Link, Callable[[Arrival, float], list[Outgoing]]]


def _punctual() -> None:
    """Ask for real-time scheduling of this thread, as RTT's tasks do; where the user may not, it stays as it is.

    It works for 0.1 ms and sleeps again. Measured on two cores that others use too, 1000 pings 20 ms apart: 99 % leave
    within 0.5 ms of their time; 3 to 7 ms otherwise, and with a niceness of -15.
    """
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))


class Station:
    """Runs a head on its links.

    Parameters
    ----------
    head : Head
    wires : sequence of (link, callable)
        The callable takes an arrival and the time, and returns what to send: a method of the head.
    make : callable
        A GL context -> Imager.
    """

    def __init__(
        self,
        head: Head,
        wires: Sequence[Wire],
        make: Callable[[Any], Imager],
        log: logging.Logger,
    ) -> None:
        self.head, self.wires, self._log = head, list(wires), log
        self._listeners: list[Listener] = []
        self._at_end: list[Callable[[], None]] = []
        self._wake = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
        self.echoes = EchoSource(make, head.settings(), self._ring, log)
        self._ready: Sonar | None = None
        self._given: PingOrder | None = None
        self._prepared = head.settings()
        self._stop = False
        self._lateness: deque[float] = deque(maxlen=_REMEMBERED)
        self._timing = Timing()
        self.failure: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="device", daemon=True)

    def listen(self, listener: Listener, at_end: Callable[[], None] | None = None) -> None:
        """Have the echoes and the messages that carried them told by the serving thread: for ports and recorders.

        Call it before ``start``; ``at_end`` is called when the device is off its links.
        """
        self._listeners.append(listener)
        self._at_end += [at_end] if at_end is not None else []

    def start(self) -> None:
        """Compile, then serve.

        Raises
        ------
        GLUnavailableError
            If there is no OpenGL; the links are closed then.
        """
        try:
            self.echoes.start()
        except BaseException:
            self._close_links()
            raise
        self._thread.start()

    def stop(self) -> None:
        """Stop serving and close the links."""
        self._stop = True
        self._ring()
        self._thread.join()
        self.echoes.stop()
        self._close_links()
        os.close(self._wake)

    def describe(self) -> str:
        """Where clients find the device."""
        return ", ".join(link.describe() for link, _ in self.wires)

    def timing(self) -> Timing:
        """How punctual the device was so far."""
        t = self._timing
        lateness = np.array(self._lateness.copy() or [0.0])  # copy() is one step for other threads
        p50, p99 = np.quantile(lateness, [0.5, 0.99])
        return Timing(t.pings, t.late, t.unsent, self.echoes.failed, float(p50), float(p99), float(lateness.max()))

    def _ring(self) -> None:
        with contextlib.suppress(OSError):
            os.eventfd_write(self._wake, 1)

    def _close_links(self) -> None:
        for link, _ in self.wires:
            link.close()
        for end in self._at_end:
            end()

    def _run(self) -> None:
        _punctual()
        try:
            while not self._stop:
                self._begin()
                self._wait()
                for link, receive in self.wires:
                    link.flush()
                    for arrival in link.receive():
                        self._send(receive(arrival, time.monotonic()))
                self._send(self.head.tick(time.monotonic()))
                self._finish()
        except Exception as error:  # seen by the task's watch and by the command line
            self._log.exception("the device stopped")
            self.failure = error

    def _begin(self) -> None:
        order = self.head.begin(time.monotonic())
        settings = order.settings if order is not None else self.head.settings()
        if order is not None:
            self._given, self._ready = order, None
            self.echoes.order(order)
        elif settings is not self._prepared:
            self.echoes.prepare(settings)
        self._prepared = settings

    def _wait(self) -> None:
        now = time.monotonic()
        until = min(now + _IDLE, self.head.next_tick())
        if self._ready is not None and self._given is self.head.order and self._given is not None:
            until = min(until, self._given.due)
        waits = [w for link, _ in self.wires if (w := link.look_again()) is not None]
        until = min(until, now + min(waits, default=_IDLE))
        read = [self._wake, *(fd for link, _ in self.wires for fd in link.readable())]
        write = [fd for link, _ in self.wires for fd in link.writable()]
        # select, not poll: its timeout is not rounded up to whole milliseconds.
        ready, _, _ = select.select(read, write, [], max(0.0, until - now))
        if self._wake in ready:
            with contextlib.suppress(BlockingIOError):
                os.eventfd_read(self._wake)

    def _finish(self) -> None:
        while (result := self.echoes.take()) is not None:
            if result[0] is self._given:
                self._ready = result[1]
        order, sample = self._given, self._ready
        if order is None or sample is None or order is not self.head.order:
            return  # not there yet, or a client has changed its mind
        now = time.monotonic()
        if now < order.due:
            return
        self._given = self._ready = None
        outgoing = self.head.finish(sample, now)
        self._account(now - order.due)  # before a client can ask
        self._timing.unsent += not self._send(outgoing)
        for listener in self._listeners:
            listener(sample, outgoing)

    def _account(self, lateness: float) -> None:
        self._timing.pings += 1
        self._timing.late += lateness > LATE
        self._lateness.append(lateness)

    def _send(self, outgoing: list[Outgoing]) -> bool:
        left = True
        for peer, data in outgoing:
            left = peer.link.send(data, peer.address) and left
        return left
