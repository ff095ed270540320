"""The thread of a task: commands, then cycles as its activity says.

Periodic deadlines are absolute, so a late cycle does not shift the next; deadlines that have passed are counted as
overruns and left out rather than caught up, since old poses and frames help nobody.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from typing import Any

from sonar_component.middleware.lifecycle import State
from sonar_component.middleware.task import Activity, Periodic, PortDriven, Task
from sonar_component.middleware.transport.loop import Bell, Loop

_IDLE = 0.5  # [s], how often a task without work looks around


class Runner:
    """Owns one thread, the task that gives it its activity, and the slaves of that task.

    Attributes
    ----------
    stepped : in lock-step nothing runs but what `step` asks for.
    """

    def __init__(self, task: Task, activity: Activity, loop: Loop | None = None, *, stepped: bool = False) -> None:
        self.task, self.activity, self.stepped = task, activity, stepped
        self.slaves: list[Task] = []
        self.bell = Bell(loop)
        self._commands: deque[tuple[Callable[[], Any], Future[Any]]] = deque()
        self._news = False  # since the last cycle; a flag, not a count: two threads that add one at once may add one
        self._deadline = 0.0
        self._stop = False
        self._thread = threading.Thread(target=self._run, name=task.name, daemon=True)
        self._was_running = False
        for name in task.inputs if stepped else self._driving_ports():
            task.inputs[name].on_arrival = self._arrived

    def start(self) -> None:
        """Begin the thread; the task itself waits for its commands."""
        self._thread.start()

    def stop(self, timeout: float = 2.0) -> bool:
        """End the thread; False if a hook does not return in time."""
        self._stop = True
        self.bell.ring()
        self._thread.join(timeout)
        return not self._thread.is_alive()

    @property
    def alive(self) -> bool:
        """Whether its thread still runs."""
        return self._thread.is_alive()

    def call(self, function: Callable[[], Any]) -> Future[Any]:
        """Run a function in the task's thread, between two cycles."""
        future: Future[Any] = Future()
        self._commands.append((function, future))
        self.bell.ring()
        return future

    def step(self, task: Task) -> None:
        """One cycle of one task, in this thread: what lock-step asks for."""
        with timed(task):
            task.cycle()

    def _driving_ports(self) -> list[str]:
        if not isinstance(self.activity, PortDriven):
            return []
        return list(self.activity.ports) or list(self.task.inputs)

    def _arrived(self) -> None:
        self._news = True
        self.bell.ring()

    def _run(self) -> None:
        while not self._stop:
            self._run_commands()
            running = self.task.lifecycle.running
            if running and not self._was_running:
                self._news = True  # RTT: a task that is started is triggered once
                self._deadline = time.monotonic()
            self._was_running = running
            if not running or self.stepped:
                self.bell.wait(_IDLE)
            elif isinstance(self.activity, Periodic):
                self._periodic(self.activity.period / self.task.clock.rate)
            else:
                self._port_driven()

    def _run_commands(self) -> None:
        while self._commands:
            function, future = self._commands.popleft()
            try:
                future.set_result(function())
            except Exception as error:
                future.set_exception(error)

    def _periodic(self, period: float) -> None:
        late = time.monotonic() - self._deadline
        if late < 0:
            self.bell.wait(-late)  # rung or not: look again
            return
        missed = int(late / period)
        self.task.counters.overruns += missed
        self._deadline += (missed + 1) * period
        self._cycle()

    def _port_driven(self) -> None:
        if not self._news:
            timeout = self.activity.timeout if isinstance(self.activity, PortDriven) else None
            if not self.bell.wait(self._patience(timeout)) and not self._commands:
                self._waited_in_vain(timeout)
            return
        self._news = False
        before = self._pending()
        self._cycle()
        if 0 < self._pending() < before:
            self._news = True  # a buffer that was read from holds more

    def _patience(self, timeout: float | None) -> float:
        ages = [c.max_age / 4 for port in self.task.inputs.values() for c in port.connections if c.max_age is not None]
        return min([*ages, _IDLE] if timeout is None else [*ages, timeout])

    def _waited_in_vain(self, timeout: float | None) -> None:
        if timeout is not None:
            self.task.counters.timeouts += 1
            self._cycle()
        else:
            self.task.watch()

    def _pending(self) -> int:
        return sum(self.task.inputs[name].pending() for name in self._driving_ports())

    def _cycle(self) -> None:
        with timed(self.task):
            self.task.cycle()
        for slave in self.slaves:
            if slave.lifecycle.state in (State.RUNNING, State.RUNTIME_ERROR):
                with timed(slave):
                    slave.cycle()


@contextmanager
def timed(task: Task) -> Iterator[None]:
    """Note that a hook runs, and how long it took."""
    counters = task.counters
    began = counters.began = time.monotonic()
    try:
        yield
    finally:
        counters.began = 0.0
        counters.last_duration = time.monotonic() - began
        counters.longest = max(counters.longest, counters.last_duration)
