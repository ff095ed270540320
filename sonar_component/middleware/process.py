"""One process of a deployment: builds its tasks, joins their ports, drives them, answers questions."""

from __future__ import annotations

import logging
import os
import time
import zlib
from collections.abc import Callable
from functools import partial
from typing import Any

from sonar_component.middleware.clock import Clock, SimulatedClock, SteppedClock, WallClock
from sonar_component.middleware.deployment.plan import ConnectionPlan, Plan, TaskPlan
from sonar_component.middleware.deployment.task_types import task_type
from sonar_component.middleware.guests import Guests
from sonar_component.middleware.introspection import Introspection
from sonar_component.middleware.ladder import MOST_GRACE, Progress
from sonar_component.middleware.lifecycle import Command, LifeCycle, State
from sonar_component.middleware.lockstep import Stepper
from sonar_component.middleware.policy import Policy
from sonar_component.middleware.ports import connect_in_process
from sonar_component.middleware.rundir import Instance, Lock
from sonar_component.middleware.runner import Runner
from sonar_component.middleware.task import Activity, Periodic, PortDriven, Task
from sonar_component.middleware.transport.control import ControlServer
from sonar_component.middleware.transport.keys import Guard, public_key
from sonar_component.middleware.transport.transport import Join, Transport
from sonar_component.settings.paths import find_file

_LOOK = 0.01  # [s], between two looks whether all is over


class Process:
    """The tasks of one process."""

    def __init__(self, plan: Plan, name: str, host: str = "") -> None:
        self.plan, self.name, self.host = plan, name, host
        self.guard: Guard | None = None
        self.instance = Instance(plan.name)
        self.planned = plan.processes(host)[name]
        self.locks: list[Lock] = []
        self.tasks: dict[str, Task] = {}
        self.runners: dict[str, Runner] = {}
        self.clock = make_clock(plan.clock)
        self.report: Any = lambda event: None
        self.failed = False

    def build(self) -> None:
        """Make the tasks and open the ports.

        Raises
        ------
        SettingsError
            If a task of that name runs already.
        """
        names = [task.name for task in self.planned]
        self.locks = [Lock(self.instance.path / f"{name}.lock", f"task {name!r}") for name in names]
        self.transport = Transport()
        if self.host and any(host["key"] for host in self.plan.hosts.values()):
            self.guard = Guard(self.transport.context, self.host)
        for planned in self.planned:
            self._make(planned)
        for planned in self.planned:
            self._thread(planned)
        for task in self.tasks.values():
            self._open_outputs(task)
        for connection in self.plan.connections:
            self._join(connection)
        stepper = Stepper(self.tasks, self.runners, self.clock) if isinstance(self.clock, SteppedClock) else None
        guests = Guests(self.transport, self.instance)
        self.introspection = Introspection(self.tasks, self.runners, self.transport, stepper, guests)
        control = self.instance.endpoint(f"{self.name}.control")
        self._answer_at(control)
        if (remote := self.plan.controls.get(f"{self.host}/{self.name}")) is not None:
            self._answer_at(remote, self._own_guard())
        for planned in self.planned:
            record = self.introspection.records[planned.name] = self._record(planned, control)
            self.instance.write_record(planned.name, record)
        for runner in set(self.runners.values()):
            runner.start()

    def _answer_at(self, endpoint: str, guard: Guard | None = None) -> None:
        loop, answer = self.transport.loop, self.introspection.answer
        self.introspection.servers.append(ControlServer(self.transport.context, [endpoint], loop, answer, guard))

    def _own_guard(self) -> Guard | None:
        """What asks others for keys: only where the file gives this host one."""
        return self.guard if self.plan.hosts[self.host]["key"] else None

    def _make(self, planned: TaskPlan) -> None:
        cls = task_type(planned.type)
        task = cls(planned.name, planned.properties, clock=self.clock, beside=self.plan.file)
        task.on_change = lambda lifecycle: self._tell(task, lifecycle)
        self.tasks[planned.name] = task

    def _thread(self, planned: TaskPlan) -> None:
        """A thread for every task but slaves, which share their master's."""
        task, master = self.tasks[planned.name], planned
        while "slave" in master.activity:
            master = self.plan.task(master.activity["slave"])
        if master.name not in self.runners:
            stepped = bool(self.plan.clock.get("lockstep"))
            activity = make_activity(master.activity)
            runner = Runner(self.tasks[master.name], activity, self.transport.loop, stepped=stepped)
            self.runners[master.name] = runner
        runner = self.runners[planned.name] = self.runners[master.name]
        if master is not planned:
            runner.slaves.append(task)

    def _open_outputs(self, task: Task) -> None:
        for port in task.outputs.values():
            self.transport.bind(port, [self.instance.endpoint(port.full_name)], self.clock.name)
            if (remote := self.plan.addresses.get(port.full_name)) is not None:
                self.transport.bind_remote(port, remote, self.clock.name, self._own_guard())
            for connection in self.plan.connections:
                if connection.source == port.full_name and self._is_reliable(connection):
                    self.transport.bind_reliable(port, self._reliable_endpoint(connection))

    def _join(self, planned: ConnectionPlan) -> None:
        reader, _, input_name = planned.target.partition(".")
        if reader not in self.tasks:
            return
        writer, _, output_name = planned.source.partition(".")
        port = self.tasks[reader].inputs[input_name]
        policy = Policy(planned.policy, planned.size, planned.init)
        if writer in self.tasks:
            connect_in_process(self.tasks[writer].outputs[output_name], port, policy, planned.max_age)
            return
        reliable = self._is_reliable(planned)
        endpoint = self._reliable_endpoint(planned) if reliable else self.instance.endpoint(planned.source)
        host, join = self.plan.task(writer).host, None
        if host != self.host:
            endpoint = self.plan.addresses[planned.source]
            join = self._join_host(self.plan.hosts[host])
        subscriber = self.transport.connect(port, planned.source, endpoint, policy, planned.max_age, join)
        subscriber.on_restart = lambda source: self.tasks[reader].upstream_restarted(source)
        runner = self.runners[reader]
        if runner.stepped or (isinstance(runner.activity, PortDriven) and runner.task.name == reader):
            runner.bell.attend(subscriber)

    def _join_host(self, host: dict[str, Any]) -> Join | None:
        if self.guard is None or not host["key"]:
            return None
        guard, key = self.guard, public_key(find_file(host["key"], self.plan.file))
        return lambda socket: guard.join(socket, key)

    def _is_reliable(self, planned: ConnectionPlan) -> bool:
        reader, writer = planned.target.partition(".")[0], planned.source.partition(".")[0]
        return planned.policy == "reliable" and not {reader, writer} <= set(self.tasks)

    def _reliable_endpoint(self, planned: ConnectionPlan) -> str:
        return self.instance.endpoint(f"{planned.source}.{zlib.crc32(planned.target.encode()):08x}")

    def _record(self, planned: TaskPlan, control: str) -> dict[str, Any]:
        task = self.tasks[planned.name]
        ports = {
            port.name: {
                "direction": "out" if port.name in task.outputs else "in",
                "type": port.schema.name,
                "version": [port.schema.major, port.schema.minor],
                "hash": port.schema.hash,
                **({"endpoint": self.instance.endpoint(port.full_name)} if port.name in task.outputs else {}),
            }
            for port in [*task.inputs.values(), *task.outputs.values()]
        }
        connections = [c.__dict__ for c in self.plan.connections if c.target.partition(".")[0] == planned.name]
        return {
            "task": planned.name, "type": planned.type, "process": self.name, "pid": os.getpid(),
            "started": time.time(), "control": control, "ports": ports, "connections": connections,
        }  # fmt: skip

    def _tell(self, task: Task, lifecycle: LifeCycle) -> None:
        event = {"event": "state", "task": task.name, "state": lifecycle.state.value}
        self.report({**event, "substate": lifecycle.substate, "reason": lifecycle.reason})
        if lifecycle.state in (State.EXCEPTION, State.FATAL_ERROR):
            self.failed = True

    def bring_up(self, name: str) -> None:
        """Order a task to configure and start, from whatever state it is in."""
        task = self.tasks[name]

        def go() -> bool:
            if task.lifecycle.state is State.EXCEPTION:
                task.lifecycle.do(Command.RECOVER)
            up = task.configure() and task.start()
            self.report({"event": "up", "task": name, "up": up, "reason": task.lifecycle.reason})
            return up

        self.runners[name].call(go)

    def close(self, timeout: float = 1.5) -> bool:
        """Stop and clean up every task, close the ports.

        False if a hook neither returns within `timeout` [s] nor works on; what works has at most `MOST_GRACE`.
        """
        shutting = {name: self.runners[name].call(partial(shut, task)) for name, task in reversed(self.tasks.items())}
        if not self._wait_for(lambda: all(future.done() for future in shutting.values()), timeout):
            self._name_busy([name for name, future in shutting.items() if not future.done()])
            return False
        for runner in set(self.runners.values()):
            runner.stop(0.0)
        ended = self._wait_for(lambda: not any(runner.alive for runner in self.runners.values()), timeout)
        if not ended:
            self._name_busy([name for name, runner in self.runners.items() if runner.alive])
        for server in self.introspection.servers:
            server.close()
        if self.guard is not None:
            self.guard.close()
        self.transport.close()
        for task in self.tasks:
            for path in self.instance.path.glob(f"{task}.*"):
                if path.suffix != ".lock":
                    path.unlink(missing_ok=True)
        for lock in self.locks:
            lock.release()
        return ended

    def _wait_for(self, done: Callable[[], bool], timeout: float) -> bool:
        progress, end = Progress(self._worked), time.monotonic() + MOST_GRACE
        while not done():
            now = time.monotonic()
            if now > end or progress.idle(now) > timeout:
                return False
            time.sleep(_LOOK)
        return True

    def _worked(self) -> float:
        """Processor time of everything but this thread, which waits, and the sockets', which serves others [s]."""
        return time.process_time() - time.thread_time() - self.transport.loop.processor_time()

    def _name_busy(self, tasks: list[str]) -> None:
        """Say which hook does not return; of tasks that share a thread it is another one's, whom they wait for."""
        doing = {name: task.doing for name, task in self.tasks.items()}
        busy = [f"{name}.{now[0]}" for name, now in doing.items() if now] or [f"{name} (between two)" for name in tasks]
        logging.getLogger(self.name).warning("does not return from its hook: %s", ", ".join(busy))

    def beat(self) -> dict[str, Any]:
        """Signs of life: cycles of each task, what it does now and for how long it has [s]."""
        now = time.monotonic()
        tasks = {
            name: {"cycles": task.counters.cycles, "doing": doing[0], "busy": now - doing[1]}
            for name, task in self.tasks.items()
            if (doing := task.doing or ("", now))
        }
        return {"event": "beat", "tasks": tasks}


def shut(task: Task) -> None:
    """Walk a task down as far as the table goes."""
    if task.lifecycle.running:
        task.stop()
    if task.lifecycle.state is State.STOPPED:
        task.cleanup()


def make_activity(values: dict[str, Any]) -> Activity:
    """An activity from the values of a plan."""
    if "periodic" in values:
        return Periodic(values["periodic"])
    return PortDriven(tuple(values.get("port_driven", ())), values.get("timeout"))


def make_clock(values: dict[str, Any]) -> Clock:
    """The clock of a plan; a simulated one counts from the launcher's start, the same for all processes."""
    if values.get("mode", "wall") == "wall":
        return WallClock()
    epoch = round(values.get("start", 0.0) * 1e6)
    if values.get("lockstep"):
        return SteppedClock(epoch, 1.0)
    return SimulatedClock(epoch, values.get("began", time.monotonic()), values.get("rate", 1.0))
