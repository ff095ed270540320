"""Lock-step: simulated time moves when everybody is ready, and not otherwise.

The conductor, in the launcher, asks the tasks of each tick in the order in which data flows; a task runs once its
inputs have received what their writers wrote before, so nothing depends on how fast a process or a socket is. The same
seeds then give the same bytes. A connection that closes a circle delivers at the next tick.

A clock port that everybody follows was the alternative: it keeps time together, but not the samples under way.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

import zmq

from sonar_component.middleware.clock import SteppedClock
from sonar_component.middleware.deployment.plan import Plan
from sonar_component.middleware.rundir import Instance
from sonar_component.middleware.runner import Runner
from sonar_component.middleware.task import Periodic, Task
from sonar_component.middleware.transport.control import ControlClient

DEFAULT_STEP = 0.1  # [s], where no task is periodic
_PATIENCE = 5.0  # [s], for one process to finish a step
_LOOK = 0.02  # [s], between two looks at tasks that come up


class Stepper:
    """Runs the tasks of one process tick by tick; part of what a process answers."""

    def __init__(self, tasks: dict[str, Task], runners: dict[str, Runner], clock: SteppedClock) -> None:
        self._tasks, self._runners, self._clock = tasks, runners, clock
        self._done: dict[str, int] = {}
        self._due: dict[str, int] = {}

    def step(self, request: dict[str, Any]) -> Future[Any]:
        """Run one task for one tick: ``task``, ``tick``, ``time`` [us] and ``seqs`` (writer -> last sequence).

        The result is the last sequence of each of its output ports. A tick that was run already is not run again, so a
        question whose answer was lost may be asked twice.
        """
        name, tick, now, seqs = request["task"], request["tick"], request["time"], request["seqs"]
        task, runner = self._tasks[name], self._runners[name]

        def run() -> dict[str, int]:
            if self._done.get(name) != tick:
                self._wait_for(task, runner, seqs)
                self._clock.time = now
                if self._is_due(task, runner, now):
                    runner.step(task)
                self._done[name] = tick
            return {port.full_name: port.seq for port in task.outputs.values()}

        return runner.call(run)

    def _wait_for(self, task: Task, runner: Runner, seqs: dict[str, int]) -> None:
        deadline = time.monotonic() + _PATIENCE
        while behind := [
            connection.source
            for port in task.inputs.values()
            for connection in port.connections
            if (connection.last.seq if connection.last else 0) < seqs.get(connection.source, 0)
        ]:
            if time.monotonic() > deadline:
                raise TimeoutError(f"{task.name} has not received what {behind[0]} wrote")
            runner.bell.wait(0.01)

    def _is_due(self, task: Task, runner: Runner, now: int) -> bool:
        activity = runner.activity if runner.task is task else None
        if isinstance(activity, Periodic):
            due = self._due.setdefault(task.name, now)
            if now < due:
                return False
            period = round(activity.period * 1e6)
            self._due[task.name] = due + (1 + (now - due) // period) * period
            return True
        return any(port.pending() for port in task.inputs.values())


class Conductor:
    """Moves time for all tasks of a plan; a thread of the launcher.

    Parameters
    ----------
    plan : with a lock-step clock.
    tell : takes events as lines.
    """

    def __init__(self, plan: Plan, tell: Callable[[str], None]) -> None:
        self._plan, self._tell = plan, tell
        self._instance = Instance(plan.name)
        self._context: zmq.Context[Any] = zmq.Context()
        self._clients: dict[str, ControlClient] = {}
        self._seqs: dict[str, int] = {}
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="conductor", daemon=True)

    def start(self) -> None:
        """Begin as soon as every task is up."""
        self._thread.start()

    def stop(self) -> None:
        """No further tick."""
        self._stop.set()
        self._thread.join(1.0)

    def _run(self) -> None:
        try:
            if self._wait_until_up():
                self._conduct()
        finally:
            for client in self._clients.values():
                client.close()

    def _conduct(self) -> None:
        clock = self._plan.clock
        step = round((clock.get("step") or step_of(self._plan)) * 1e6)
        now, began = round(clock.get("start", 0.0) * 1e6), time.monotonic()
        order = order_of(self._plan)
        tick = 0
        while not self._stop.is_set():
            for name in order:
                self._step(name, tick, now + tick * step)
            tick += 1
            ahead = tick * step * 1e-6 / clock.get("rate", 1.0) - (time.monotonic() - began)
            if ahead > 0:
                self._stop.wait(ahead)

    def _step(self, name: str, tick: int, now: int) -> None:
        error = self._stepped(name, tick, now)
        if error:
            self._tell(f"lock-step waits for {name}: {error}")
        while error and not self._stop.wait(_LOOK):
            self._seqs = {}  # a process that begins anew counts anew
            error = self._stepped(name, tick, now)

    def _stepped(self, name: str, tick: int, now: int) -> str:
        """Ask for one step; why it could not be made, or the empty string."""
        try:
            answer = self._ask(name, "step", tick=tick, time=now, seqs=self._seqs)
        except (TimeoutError, RuntimeError, OSError) as error:
            return str(error)
        self._seqs.update(answer)
        return ""

    def _wait_until_up(self) -> bool:
        """Every task runs and every connection is made, or its first sample could be missed."""
        wanted: dict[str, int] = {}
        for connection in self._plan.connections:
            wanted[connection.source] = wanted.get(connection.source, 0) + 1
        while not self._stop.is_set():
            try:
                found = [self._ask(task.name, "describe") for task in self._plan.tasks]
            except (TimeoutError, RuntimeError, OSError):
                found = []
            counts = {f"{d['task']}.{port}": o["listeners"] for d in found for port, o in d["outputs"].items()}
            running = found and all(d["state"] == "RUNNING" for d in found)
            if running and all(counts.get(port, 0) >= count for port, count in wanted.items()):
                return True
            self._stop.wait(_LOOK)
        return False

    def _ask(self, name: str, op: str, **arguments: Any) -> Any:
        process = self._plan.task(name).process
        if process not in self._clients:
            endpoint = self._instance.endpoint(f"{process}.control")
            self._clients[process] = ControlClient(self._context, endpoint)
        return self._clients[process].ask(op, 1.0 if op == "describe" else _PATIENCE + 1, task=name, **arguments)


def step_of(plan: Plan) -> float:
    """The longest step that meets every period [s]."""
    periods = [round(task.activity["periodic"] * 1e6) for task in plan.tasks if "periodic" in task.activity]
    return math.gcd(*periods) * 1e-6 if periods else DEFAULT_STEP


def order_of(plan: Plan) -> list[str]:
    """Tasks in the order in which data flows; within a circle in that of the file."""
    writers: dict[str, set[str]] = {task.name: set() for task in plan.tasks}
    for connection in plan.connections:
        writers[connection.target.partition(".")[0]].add(connection.source.partition(".")[0])
    for task in plan.tasks:
        if "slave" in task.activity:
            writers[task.name].add(task.activity["slave"])
    order: list[str] = []
    left = [task.name for task in plan.tasks]
    while left:
        ready = [name for name in left if not (writers[name] - {name}) & set(left)] or left[:1]
        order += ready
        left = [name for name in left if name not in ready]
    return order
