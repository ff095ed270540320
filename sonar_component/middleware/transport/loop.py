"""One thread per process that looks after all sockets nobody else is looking at, and the bell that wakes a task.

Every socket has a lock and may be served by any thread that holds it, which libzmq allows. So a writer sends in its own
thread, and a reader that waits drains its own sockets: a queue between threads in either place costs 20 to 50 us, about
half of what a pose takes in all. While a reader computes, this thread drains for it, so that a sample is never older in
the mailbox than on the wire.

libzmq's file descriptors tell of *changes* only: whoever touches a socket must afterwards empty it. `serve` of each
watched object does so; where it fails half-way it is called again, or what is left in the socket would never show.
"""

from __future__ import annotations

import logging
import os
import select
import threading
import time
from collections.abc import Callable
from typing import Protocol

_EVENTS = select.EPOLLIN
_AFTER_FAILURE = 0.1  # [s], until something that raised is served again
_log = logging.getLogger("transport")


class Served(Protocol):
    """Something with a file descriptor that tells when to serve it."""

    fd: int

    def serve(self) -> None:
        """Take everything that is there; called with any thread's hands."""


class Attended(Protocol):
    """The same, of which its reader may say that the descriptor has told of something."""

    fd: int

    def serve(self, told: bool = False) -> None:
        """Take everything that is there."""


class Loop:
    """The thread; daemonic, since it holds nothing that must be written back."""

    def __init__(self, name: str = "io") -> None:
        self._epoll = select.epoll()
        self._bell = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._epoll.register(self._bell, _EVENTS)
        self._served: dict[int, Served] = {}
        self._timers: list[tuple[float, Callable[[], None]]] = []
        self._calls: list[Callable[[], None]] = []
        self._lock = threading.Lock()
        self._stop = False
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """End; the sockets stay open."""
        self._stop = True
        os.eventfd_write(self._bell, 1)
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._thread.join(2.0)

    def processor_time(self) -> float:
        """What the thread has used [s]; 0 where it does not run."""
        number = self._thread.ident
        if number is None or not self._thread.is_alive():
            return 0.0
        return time.clock_gettime(time.pthread_getcpuclockid(number))

    def call(self, function: Callable[[], None]) -> None:
        """Run a function soon, in the loop's thread."""
        with self._lock:
            self._calls.append(function)
        os.eventfd_write(self._bell, 1)

    def add(self, served: Served) -> None:
        """Watch an object; it is served once at once, to arm its descriptor."""
        with self._lock:
            self._served[served.fd] = served
        self._epoll.register(served.fd, _EVENTS)
        self.call(lambda: self._serve(served))

    def remove(self, served: Served) -> None:
        """Stop watching."""
        with self._lock:
            self._served.pop(served.fd, None)
        try:
            self._epoll.unregister(served.fd)
        except (OSError, ValueError):
            return  # closed already

    def leave(self, fd: int) -> None:
        """A waiting reader looks after this descriptor itself for now."""
        self._epoll.modify(fd, 0)

    def resume(self, fd: int) -> None:
        """The reader has gone to compute; whatever it left unread shows at once."""
        self._epoll.modify(fd, _EVENTS)

    def after(self, delay: float, function: Callable[[], None]) -> None:
        """Run a function once, in the loop's thread, about `delay` seconds from now."""
        self._set(delay, function)
        os.eventfd_write(self._bell, 1)

    def every(self, period: float, function: Callable[[], None]) -> None:
        """Run a function about every `period` seconds, in the loop's thread."""

        def again() -> None:
            self._set(period, again)
            function()

        self._set(period, again)

    def _set(self, delay: float, function: Callable[[], None]) -> None:
        with self._lock:
            self._timers.append((time.monotonic() + delay, function))

    def _run(self) -> None:
        while not self._stop:
            with self._lock:
                due = min((at for at, _ in self._timers), default=time.monotonic() + 1.0)
            ready = self._epoll.poll(max(0.0, min(1.0, due - time.monotonic())))
            for fd, _ in ready:
                served = self._served.get(fd)
                if served is not None:
                    self._serve(served)
            self._run_calls()
            for function in self._elapsed():
                _guarded(function)

    def _serve(self, served: Served | Attended) -> None:
        if not _guarded(served.serve):
            self.after(_AFTER_FAILURE, lambda: self._serve_again(served))

    def _serve_again(self, served: Served | Attended) -> None:
        if self._served.get(served.fd) is served:
            self._serve(served)

    def _elapsed(self) -> list[Callable[[], None]]:
        with self._lock:
            now = time.monotonic()
            elapsed = [function for at, function in self._timers if at <= now]
            self._timers = [timer for timer in self._timers if timer[0] > now]
        return elapsed

    def _run_calls(self) -> None:
        try:
            os.eventfd_read(self._bell)
        except BlockingIOError:
            return
        with self._lock:
            calls, self._calls = self._calls, []
        for function in calls:
            _guarded(function)


def _guarded(function: Callable[[], None]) -> bool:
    """Whether it went well; one failure must not end the thread on which all sockets of the process depend."""
    try:
        function()
    except Exception:
        _log.exception("a socket could not be served")
        return False
    return True


class Bell:
    """Wakes one waiting thread, from any other thread or from the sockets that it attends."""

    def __init__(self, loop: Loop | None = None) -> None:
        self._loop = loop
        self._fd = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._epoll = select.epoll()
        self._epoll.register(self._fd, _EVENTS)
        self._attended: dict[int, Attended] = {}
        self._rung = self._waiting = False

    def attend(self, served: Attended) -> None:
        """Serve this object while waiting."""
        self._attended[served.fd] = served
        self._epoll.register(served.fd, _EVENTS)

    def ring(self) -> None:
        """Wake the waiter, or keep it from falling asleep; costs no system call unless it sleeps."""
        self._rung = True  # in this order, as `_sleep` looks in the other
        if self._waiting:
            os.eventfd_write(self._fd, 1)

    def wait(self, timeout: float | None) -> bool:
        """Sleep until rung; True if it was. Serves the attended sockets meanwhile."""
        loop = self._loop
        for fd in self._attended:
            if loop:
                loop.leave(fd)
        try:
            for served in self._attended.values():
                served.serve()
            rung = self._sleep(timeout)
            if rung:
                self._rung = False  # only now: what rings from here on is for the next wait
            return rung
        finally:
            self._waiting = False
            for fd in self._attended:
                if loop:
                    loop.resume(fd)

    def _sleep(self, timeout: float | None) -> bool:
        deadline = None if timeout is None else time.monotonic() + timeout
        while True:
            self._waiting = True
            if self._rung:
                return True
            left = None if deadline is None else deadline - time.monotonic()
            if left is not None and left <= 0:
                return False
            if left is not None and left < 0.001:
                time.sleep(left)  # epoll counts whole milliseconds
                continue
            events = self._epoll.poll(-1 if left is None else int(left * 1000) / 1000)
            self._waiting = False  # what comes while we look is seen without a bell
            for fd, _ in events:
                if fd in self._attended:
                    self._attended[fd].serve(True)
                else:
                    self._hush()

    def _hush(self) -> None:
        try:
            os.eventfd_read(self._fd)
        except BlockingIOError:
            return

    def close(self) -> None:
        """Give the descriptors back."""
        self._epoll.close()
        os.close(self._fd)
