"""One process of a deployment: builds its tasks, joins their ports, drives them, answers questions, reports upwards.

Started by the supervisor with a plan, and two pipes: orders come in as lines of JSON, events go out the same way.
"""

from __future__ import annotations

import faulthandler
import json
import logging
import os
import select
import signal
import sys
import time
import zlib
from concurrent.futures import wait
from functools import partial
from typing import Any

from sonar_component.middleware.clock import Clock, SimulatedClock, SteppedClock, WallClock
from sonar_component.middleware.deployment.plan import ConnectionPlan, Plan, TaskPlan
from sonar_component.middleware.deployment.task_types import task_type
from sonar_component.middleware.guests import Guests
from sonar_component.middleware.introspection import Introspection
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

BEAT = 0.5  # [s], between signs of life


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
        """Stop and clean up every task, close the ports; False if a hook does not return in time."""
        deadline = time.monotonic() + timeout
        futures = [self.runners[name].call(partial(shut, task)) for name, task in reversed(self.tasks.items())]
        if wait(futures, max(0.0, deadline - time.monotonic())).not_done:
            busy = [name for name, task in self.tasks.items() if task.lifecycle.running]
            logging.getLogger(self.name).warning("does not return from its hook: %s", ", ".join(busy))
            return False
        ended = [runner.stop(max(0.1, deadline - time.monotonic())) for runner in set(self.runners.values())]
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
        return all(ended)

    def beat(self) -> dict[str, Any]:
        """Signs of life: cycles of each task, and for how long its present cycle has been running [s]."""
        now = time.monotonic()
        tasks = {
            name: {"cycles": task.counters.cycles, "busy": now - task.counters.began if task.counters.began else 0.0}
            for name, task in self.tasks.items()
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


class _Reports:
    """Events to the supervisor, one line of JSON each."""

    def __init__(self, fd: int) -> None:
        self._fd = fd

    def __call__(self, event: dict[str, Any]) -> None:
        try:
            os.write(self._fd, (json.dumps(event) + "\n").encode())  # below PIPE_BUF, so lines never mix
        except OSError:
            return  # the supervisor is gone; the kernel ends us next


class _WarningsUpwards(logging.Handler):
    """Warnings of tasks are shown by the launcher too."""

    def __init__(self, report: _Reports) -> None:
        super().__init__(logging.WARNING)
        self._report = report

    def emit(self, record: logging.LogRecord) -> None:
        text = record.getMessage().splitlines()[0][:500]
        self._report({"event": "log", "task": record.name, "level": record.levelname.lower(), "text": text})


def main(plan_file: str, name: str, host: str, events: str) -> None:
    """Entry point of a child process."""
    faulthandler.register(signal.SIGUSR1, all_threads=True)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the launcher decides
    report = _Reports(int(events))
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    logging.getLogger().addHandler(_WarningsUpwards(report))
    with open(plan_file, encoding="utf-8") as file:
        process = Process(Plan.from_json(file.read()), name, host)
    process.report = report
    try:
        process.build()
    except Exception as error:
        logging.getLogger(name).exception("could not be built")
        report({"event": "refused", "reason": str(error)})
        sys.exit(1)
    report({"event": "built"})
    for task in process.tasks:
        process.bring_up(task)
    _obey(process, report)
    sys.exit(0 if process.close() and not process.failed else 1)


def _obey(process: Process, report: _Reports) -> None:
    """Take orders until told to stop."""
    wake = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
    signal.signal(signal.SIGTERM, lambda *_: os.eventfd_write(wake, 1))
    pending = b""
    while True:
        ready, _, _ = select.select([0, wake], [], [], BEAT)
        if wake in ready:
            return
        if 0 in ready:
            got = os.read(0, 65536)
            if not got:
                return
            *lines, pending = (pending + got).split(b"\n")
            for line in lines:
                order = json.loads(line)
                if order["order"] == "stop":
                    return
                if order["order"] == "bring_up":
                    process.bring_up(order["task"])
        report(process.beat())
