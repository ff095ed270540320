"""The launcher: starts the processes of a plan, watches them, starts again what fails, stops them.

It stops them by the ladder of ladder.py; a second Ctrl-C kills at once. Children are killed by the kernel if the
launcher itself is killed. circus, honcho and supervisord were looked at: none knows of states of tasks or of cycles
that stay away.
"""

from __future__ import annotations

import os
import selectors
import signal
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from sonar_component.middleware.child import Child
from sonar_component.middleware.deployment.plan import Plan, RestartPlan
from sonar_component.middleware.ladder import MOST_GRACE
from sonar_component.middleware.lockstep import Conductor
from sonar_component.middleware.process_log import ProcessLog
from sonar_component.middleware.rundir import Instance, logs

MAX_DELAY = 10.0  # [s], between two restarts
_SETTLED = 10.0  # [s] of running after which the delay is short again
_DUMP = 0.2  # [s] that a hung process has to write its stack
_END = MOST_GRACE + 5.0  # [s] after which a process that SIGKILL does not end (a disk that hangs) is left behind


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
        self.children = [self._child(name) for name in plan.processes(host)]

    def _child(self, name: str) -> Child:
        tasks = [task.name for task in self.plan.processes(self.host)[name]]
        rules = self.plan.restart.get(name, RestartPlan())
        return Child(name, tasks, rules, ProcessLog(logs(self.plan.name) / f"{name}.log"))

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
        if self.failures:
            self.tell("not well: " + "; ".join(f"{what}: {why}" for what, why in self.failures.items()))
        return 1 if self.failures else 0

    def _signalled(self, number: int, frame: object) -> None:
        self._signals += 1
        os.eventfd_write(self._wake, 1)

    def _start(self, child: Child) -> None:
        child.start(self.instance.path / "plan.json", self.host)
        for pipe, take in ((child.events, self._read), (child.output, self._keep)):
            assert pipe is not None
            self._selector.register(pipe, selectors.EVENT_READ, partial(take, child))

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
                key.data()
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
        """Take events; False where none will come any more."""
        events = child.told()
        if events is None:
            self._forget(child.events)
            return False
        for event in events:
            self._event(child, event)
        return bool(events)

    def _keep(self, child: Child) -> None:
        known = child.log.error
        if not child.keep_output():
            self._forget(child.output)
        if child.log.error != known:
            self.tell(f"{child.log.path} cannot be written: {child.log.error}")

    def _forget(self, pipe: Any) -> None:
        if pipe is not None and pipe in self._selector.get_map():
            self._selector.unregister(pipe)

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
            for task, now in event["tasks"].items():
                if now["busy"] > child.patience(now["doing"]) and not child.hung and not child.stopping:
                    what = "cycle" if now["doing"] in ("update_hook", "error_hook") else now["doing"]
                    self._hang(child, f"task {task} has not finished its {what} for {now['busy']:.1f} s")

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
            child.kill(signal.SIGTERM)
        else:
            child.mending[task] = time.monotonic() + child.delay

    def _bring_up(self, child: Child, now: float) -> None:
        for task in [task for task, due in child.mending.items() if now >= due]:
            del child.mending[task]
            child.order({"order": "bring_up", "task": task})

    def _look_for_hang(self, child: Child, now: float) -> None:
        silence = now - child.last_beat
        if silence > child.patience() and not child.hung:
            self._hang(child, f"process {child.name} has given no sign of life for {silence:.1f} s")

    def _hang(self, child: Child, reason: str) -> None:
        child.hung = reason
        self.tell(f"{reason}: its stack is in {child.log.path}; it is killed")
        child.kill(signal.SIGUSR1)  # faulthandler writes every thread's stack, even without the interpreter
        time.sleep(_DUMP)
        child.kill(signal.SIGKILL)

    def _ended(self, child: Child) -> None:
        assert child.process is not None
        while self._read(child):
            pass
        child.keep_rest()
        child.close(self._forget)
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
            last = f" ({child.log.last_line})" if child.log.last_line else ""
            self.tell(f"process {child.name} {how}{why}; see {child.log.path}{last}")

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

    def _stop_all(self) -> None:
        """The ladder, for each process by itself."""
        for child in self.children:
            child.stop()
        signals, end = max(self._signals, 1), time.monotonic() + _END
        while self._living() and self._signals <= signals and time.monotonic() < end:
            self._turn(0.02)
            for child in self._living():
                number = child.ladder.due(time.monotonic()) if child.ladder is not None else None
                if number is not None:
                    self._force(child, number)
        self._kill_the_rest()
        for child in self.children:
            child.close(self._forget)
            child.log.close()
        self._selector.close()
        os.close(self._wake)

    def _living(self) -> list[Child]:
        return [child for child in self.children if child.process is not None]

    def _force(self, child: Child, number: signal.Signals) -> None:
        self.tell(f"process {child.name} does not stop: {number.name}")
        self.failures[f"process {child.name}"] = "had to be stopped by force"
        child.kill(number)

    def _kill_the_rest(self) -> None:
        """After a second signal: nobody waits any longer."""
        for child in self._living():
            self._force(child, signal.SIGKILL)
        end = time.monotonic() + 1.0
        while self._living() and time.monotonic() < end:
            self._turn(0.02)
