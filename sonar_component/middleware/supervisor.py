"""The launcher: starts the processes of a plan, watches them, stops them by the ladder.

Stop: an order down the pipe, SIGTERM after `GRACE`, SIGKILL after `TERM_GRACE` more; a second Ctrl-C kills at once.
Children are killed by the kernel if the launcher itself is killed. circus, honcho and supervisord were looked at: none
knows of states of tasks or of cycles that stay away.
"""

from __future__ import annotations

import json
import os
import selectors
import signal
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import IO, Any

from sonar_component.middleware.deployment.plan import Plan, RestartPlan
from sonar_component.middleware.lockstep import Conductor
from sonar_component.middleware.rundir import Instance, logs

GRACE, TERM_GRACE = 2.0, 1.0  # [s]
MAX_DELAY = 10.0  # [s], between two restarts
_SETTLED = 10.0  # [s] of running after which the delay is short again
_STARTUP = 60.0  # [s] without a sign of life that imports, configuration and a first cycle that compiles may take
_CHILD = (
    "import sys; from sonar_component.middleware.lifeline import die_with; die_with(int(sys.argv[1]));"
    "from sonar_component.middleware.process import main; main(*sys.argv[2:])"
)
# glibc gives a megabyte back to the kernel at each free() unless told otherwise; measured: 58 % more frames over tcp.
_MALLOC = {"MALLOC_MMAP_THRESHOLD_": str(32 << 20), "MALLOC_TRIM_THRESHOLD_": str(64 << 20)}


@dataclass
class Child:
    """One process: what runs now, and what happened to those before it."""

    name: str
    tasks: list[str]
    rules: RestartPlan
    log: Path
    process: subprocess.Popen[bytes] | None = None
    events: IO[bytes] | None = None
    pending: bytes = b""
    started: float = 0.0
    last_beat: float = 0.0
    young: bool = True
    restarts: deque[float] = field(default_factory=deque)
    delay: float = 0.0
    due: float | None = None
    mending: dict[str, float] = field(default_factory=dict)
    stopping: bool = False
    given_up: bool = False
    hung: str = ""
    refused: bool = False

    @property
    def patience(self) -> float:
        """Seconds without a finished cycle or a sign of life after which it hangs."""
        return max(_STARTUP, self.rules.hang_timeout) if self.young else self.rules.hang_timeout


class Supervisor:
    """Runs a plan to its end.

    Parameters
    ----------
    plan : checked.
    tell : takes each event as one line.
    """

    def __init__(self, plan: Plan, tell: Callable[[str], None], host: str = "") -> None:
        self.plan = replace(plan, clock={**plan.clock, "began": time.monotonic()})
        self.tell, self.host = tell, host
        self.instance = Instance(plan.name)
        self.states: dict[str, tuple[str, str]] = {}
        self.failures: dict[str, str] = {}  # task or process -> why; what comes up again is forgiven
        self._down: set[str] = set()  # refused to come up, by their own decision
        self._selector = selectors.DefaultSelector()
        self._signals = 0
        self._conductor: Conductor | None = None
        self._wake = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
        self._selector.register(self._wake, selectors.EVENT_READ, None)
        folder = logs(plan.name)
        self.children = [
            Child(name, [t.name for t in tasks], plan.restart.get(name, RestartPlan()), folder / f"{name}.log")
            for name, tasks in plan.processes(host).items()
        ]

    def run(self, seconds: float | None = None) -> int:
        """Run until told to stop, all is over, or `seconds` have passed; the exit code.

        Raises
        ------
        SettingsError
            If an instance of that name runs already.
        """
        lock = self.instance.create()
        before = [(number, signal.signal(number, self._signalled)) for number in (signal.SIGINT, signal.SIGTERM)]
        try:
            (self.instance.path / "plan.json").write_text(self.plan.to_json())
            for child in self.children:
                self._start(child)
            if self.plan.clock.get("lockstep"):
                self._conductor = Conductor(self.plan, self.tell)
                self._conductor.start()
            self._watch(seconds)
        finally:
            if self._conductor is not None:
                self._conductor.stop()
            self._stop_all()
            for number, handler in before:
                signal.signal(number, handler)
            self.instance.remove()
            lock.release()
        return 1 if self.failures else 0

    def _signalled(self, number: int, frame: object) -> None:
        self._signals += 1
        os.eventfd_write(self._wake, 1)

    def _start(self, child: Child) -> None:
        read, write = os.pipe()
        command = [sys.executable, "-c", _CHILD, str(os.getpid()), str(self.instance.path / "plan.json"), child.name]
        with open(child.log, "ab" if child.restarts else "wb") as log:
            child.process = subprocess.Popen(
                [*command, self.host, str(write)], stdin=subprocess.PIPE, stdout=log, stderr=log,
                pass_fds=[write], start_new_session=True, env={**_MALLOC, **os.environ},
            )  # fmt: skip
        os.close(write)
        os.set_blocking(read, False)
        child.events = os.fdopen(read, "rb", buffering=0)
        child.pending, child.young, child.due, child.hung = b"", True, None, ""
        child.mending.clear()
        child.started = child.last_beat = time.monotonic()
        self._selector.register(child.events, selectors.EVENT_READ, child)

    def _watch(self, seconds: float | None) -> None:
        end = None if seconds is None else time.monotonic() + seconds
        while not self._signals and (end is None or time.monotonic() < end):
            self._turn(0.1 if end is None else max(0.0, min(0.1, end - time.monotonic())))
            if all(child.process is None and child.due is None for child in self.children):
                self.tell("all processes have ended")
                return
            if any(child.given_up and child.rules.critical for child in self.children):
                self.tell("a critical task is lost: stopping all")
                return
            if self._hopeless():
                self.tell("no task could be started: stopping")
                return

    def _hopeless(self) -> bool:
        """Whether every task has refused to be configured or started."""
        return {task for child in self.children for task in child.tasks} <= self._down

    def _turn(self, timeout: float) -> None:
        """Wait for events, look after every child once."""
        for key, _ in self._selector.select(timeout):
            if key.data is None:
                os.eventfd_read(self._wake)
            else:
                self._read(key.data)
        now = time.monotonic()
        for child in self.children:
            if child.process is not None and child.process.poll() is not None:
                self._ended(child)
            elif child.process is not None and not child.stopping:
                self._look_for_hang(child, now)
                self._bring_up(child, now)
            elif child.due is not None and now >= child.due:
                self._start(child)

    def _read(self, child: Child) -> bool:
        """Take events; False if there were none."""
        got = child.events.read(1 << 16) if child.events is not None else b""
        if got == b"":
            self._forget_pipe(child)
        if not got:
            return False
        *lines, child.pending = (child.pending + got).split(b"\n")
        for line in lines:
            self._event(child, json.loads(line))
        return True

    def _forget_pipe(self, child: Child) -> None:
        if child.events is not None:
            self._selector.unregister(child.events)
            child.events.close()
            child.events = None

    def _event(self, child: Child, event: dict[str, Any]) -> None:
        kind = event["event"]
        child.last_beat = time.monotonic()
        if kind == "state":
            self._state(child, event)
        elif kind == "log":
            self.tell(f"{event['task']}: {event['level']}: {event['text']}")
        elif kind == "refused":
            self.tell(f"process {child.name} could not start: {event['reason']}")
            child.refused = True
        elif kind == "up":
            if event["up"]:
                self._down.discard(event["task"])
                self.failures.pop(event["task"], None)
                self.failures.pop(f"process {child.name}", None)
            else:
                self._down.add(event["task"])
                self.failures[event["task"]] = event["reason"]
        elif kind == "beat":
            child.young = any(v["cycles"] <= 1 for v in event["tasks"].values())
            busy = [(t, v["busy"]) for t, v in event["tasks"].items() if v["busy"] > child.patience]
            if busy and not child.hung and not child.stopping:
                self._hang(child, f"task {busy[0][0]} has not finished its cycle for {busy[0][1]:.1f} s")

    def _state(self, child: Child, event: dict[str, Any]) -> None:
        task, state, reason = event["task"], event["state"], event["reason"]
        before = self.states.get(task, ("", ""))[0]
        if state == "STOPPED" and before in ("", "PRE_OPERATIONAL"):
            return  # on its way up: the next event says where it came to
        self.states[task] = (state, reason)
        named = f" {event['substate']}" if event["substate"] else ""
        if not (child.stopping and state in ("STOPPED", "PRE_OPERATIONAL")):
            self.tell(f"{task}: {state}{named}" + (f": {reason}" if reason else ""))
        if child.stopping:
            return
        if state in ("EXCEPTION", "FATAL_ERROR"):
            self.failures[task] = f"{state} {reason}"
            self._mend(child, task, state)

    def _mend(self, child: Child, task: str, state: str) -> None:
        """Bring a failed task up again: in its process after EXCEPTION, with its process after FATAL_ERROR."""
        if child.rules.restart == "never" or not self._may_restart(child):
            child.given_up = child.given_up or child.rules.restart != "never"
            return
        if state == "FATAL_ERROR":
            self._kill(child, signal.SIGTERM)
        else:
            child.mending[task] = time.monotonic() + child.delay

    def _bring_up(self, child: Child, now: float) -> None:
        for task in [task for task, due in child.mending.items() if now >= due]:
            del child.mending[task]
            self._order(child, {"order": "bring_up", "task": task})

    def _look_for_hang(self, child: Child, now: float) -> None:
        silence = now - child.last_beat
        if silence > child.patience and not child.hung:
            self._hang(child, f"process {child.name} has given no sign of life for {silence:.1f} s")

    def _hang(self, child: Child, reason: str) -> None:
        child.hung = reason
        self.tell(f"{reason}: its stack is in {child.log}; it is killed")
        self._kill(child, signal.SIGUSR1)  # faulthandler writes every thread's stack, even without the interpreter
        time.sleep(0.2)
        self._kill(child, signal.SIGKILL)

    def _ended(self, child: Child) -> None:
        assert child.process is not None
        while self._read(child):
            pass
        self._forget_pipe(child)
        code, child.process = child.process.returncode, None
        for task in child.tasks:
            self.states.pop(task, None)
        if child.stopping:
            if code > 0:
                self.failures[f"process {child.name}"] = f"ended with code {code}"
            return
        how = f"was killed by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"
        wanted = child.rules.restart == "always" or (child.rules.restart == "on_failure" and code != 0)
        wanted = wanted and not child.refused  # a second try would be refused too
        if code != 0:
            self.failures[f"process {child.name}"] = how
        if wanted and self._may_restart(child):
            child.due = time.monotonic() + child.delay
            self.tell(f"process {child.name} {how}; it starts again in {child.delay:g} s")
        else:
            child.given_up = True
            why = (
                "" if not wanted else f"; {len(child.restarts)} restarts in {child.rules.restart_window:g} s are enough"
            )
            self.tell(f"process {child.name} {how}{why}; see {child.log}{self._last_line(child)}")

    def _may_restart(self, child: Child) -> bool:
        """Count a restart; False if there were too many within the window."""
        now, rules = time.monotonic(), child.rules
        while child.restarts and now - child.restarts[0] > rules.restart_window:
            child.restarts.popleft()
        if len(child.restarts) >= rules.max_restarts:
            return False
        settled = now - child.started > _SETTLED or not child.restarts
        child.delay = rules.restart_delay if settled else min(MAX_DELAY, child.delay * 2)
        child.restarts.append(now)
        return True

    def _last_line(self, child: Child) -> str:
        lines = child.log.read_text(errors="replace").strip().splitlines()[-1:]
        return f" ({lines[0][:200]})" if lines else ""

    def _order(self, child: Child, order: dict[str, Any]) -> None:
        if child.process is None or child.process.stdin is None:
            return
        try:
            child.process.stdin.write((json.dumps(order) + "\n").encode())
            child.process.stdin.flush()
        except OSError:
            return  # it has just ended; the next turn sees that

    def _kill(self, child: Child, number: int) -> None:
        if child.process is not None and child.process.poll() is None:
            child.process.send_signal(number)

    def _stop_all(self) -> None:
        """The ladder."""
        for child in self.children:
            child.stopping, child.due = True, None
            self._order(child, {"order": "stop"})
        for number, patience in ((signal.SIGTERM, GRACE), (signal.SIGKILL, TERM_GRACE), (None, 1.0)):
            if self._all_gone(patience) or number is None:
                break
            for child in self.children:
                if child.process is not None:
                    self.tell(f"process {child.name} does not stop: {signal.Signals(number).name}")
                    self.failures[f"process {child.name}"] = "had to be stopped by force"
                    self._kill(child, number)
        for child in self.children:
            self._forget_pipe(child)
        self._selector.close()
        os.close(self._wake)

    def _all_gone(self, patience: float) -> bool:
        deadline, signals = time.monotonic() + patience, self._signals
        while any(child.process is not None for child in self.children):
            if time.monotonic() > deadline or self._signals > max(signals, 1):
                return False
            self._turn(0.02)
        return True
