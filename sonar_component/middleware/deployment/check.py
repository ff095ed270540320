"""Every mistake of a deployment, before anything starts.

All names are resolved here, with what the task types declare; the result is a plan that needs no further questions.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sonar_component.middleware.deployment.file import ActivityFile, ConnectionFile, DeploymentFile, TaskFile
from sonar_component.middleware.deployment.hosts import Hosts
from sonar_component.middleware.deployment.overlay import task_properties
from sonar_component.middleware.deployment.plan import ConnectionPlan, Plan, RestartPlan, TaskPlan
from sonar_component.middleware.deployment.sound import UNSOUND, Sound, in_order, sound_part
from sonar_component.middleware.deployment.task_types import task_type
from sonar_component.middleware.policy import Policy
from sonar_component.middleware.ports import InputPort, OutputPort
from sonar_component.middleware.rundir import is_name
from sonar_component.middleware.task import Activity, Periodic, PortDriven, Task, ports_of
from sonar_component.settings.errors import SettingsError, SettingsErrors, suggest
from sonar_component.settings.loader import Document, KeyPath, load_yaml

Overrides = Mapping[str, Mapping[str, Any]]


def check_deployment(path: str | Path, overrides: Overrides | None = None, name: str | None = None) -> Plan:
    """Read a deployment file and resolve everything in it.

    Parameters
    ----------
    path : the file.
    overrides : task -> property -> value, laid over the file (``--set``).
    name : of the instance, instead of the file's.

    Raises
    ------
    SettingsErrors
        All mistakes, each with file, line, column and the nearest valid name.
    """
    repeated: list[SettingsError] = []
    document = load_yaml(path, repeated=repeated)
    _override(document, overrides or {})
    sound = sound_part(document)
    sound.mistakes += repeated
    if sound.file is None:
        raise in_order(sound.mistakes, document.file)
    return _Checker(sound, sound.file).plan(name)


def _override(document: Document, overrides: Overrides) -> None:
    tasks = document.at(("tasks",))
    for task, values in overrides.items() if isinstance(tasks, dict) else ():
        if task not in tasks:
            known = ", ".join(map(str, tasks))
            raise SettingsError(f"--set: no task {task!r}{suggest(task, map(str, tasks))}; there are: {known}")
        if isinstance(tasks[task], dict) and isinstance(tasks[task].get("properties") or {}, dict):
            tasks[task] = {**tasks[task], "properties": {**(tasks[task].get("properties") or {}), **values}}


class _Checker:
    """Collects mistakes while it resolves."""

    def __init__(self, sound: Sound, file: DeploymentFile) -> None:
        self.sound, self.document, self.file = sound, sound.document, file
        self.errors: list[SettingsError] = list(sound.mistakes)
        self.types: dict[str, type[Task]] = {}
        self.hosts = Hosts(file, self.wrong)
        self.unclear: set[str] = set()  # tasks, and input ports, that a target with a mistake may have meant

    def wrong(self, path: KeyPath, message: str) -> None:
        self.errors.append(self.document.error(path, message))

    def plan(self, name: str | None) -> Plan:
        name = name or self.file.name or _name_of(Path(self.document.file))
        if not is_name(name):
            self.wrong(("name",), f"must be letters, digits, _ and -, from a letter on, got {name!r}")
        tasks = [task for key, spec in self.file.tasks.items() if (task := self._task(key, spec)) is not None]
        connections = self._connections()
        connections += self._automatic(connections)
        self._required(connections)
        self._slaves(tasks)
        addresses, controls = self._across_hosts(connections)
        if self.errors:
            raise in_order(self.errors, self.document.file)
        hosts = {key: dict(host) for key, host in self.file.hosts.items()}
        restart = {task.process: self._restart(task) for task in tasks}
        clock = dict(self.file.clock)
        file = str(Path(self.document.file).resolve())
        return Plan(name, file, tasks, connections, clock, restart, addresses, controls, hosts, self.hosts.open)

    def _across_hosts(self, connections: list[ConnectionPlan]) -> tuple[dict[str, str], dict[str, str]]:
        """Addresses of ports and processes; none where it is not certain which host a task is on."""
        wrong = self.sound.lacks("hosts") or any(self.sound.lacks("tasks", name, "host") for name in self.file.tasks)
        if wrong or not set(self.hosts.of.values()) <= {*self.file.hosts, ""}:
            return {}, {}
        self._reliable_on_one_host()
        return self.hosts.plan(connections)

    def _reliable_on_one_host(self) -> None:
        for index, spec in enumerate(self.file.connections):
            ends = {self.hosts.of.get(end.partition(".")[0]) for end in [spec.source, *spec.to]}
            if spec.policy.kind == "reliable" and len(ends - {None}) > 1:
                self.wrong(("connections", index), "a reliable connection must stay on one host")

    def _host(self, name: str, given: str | None) -> str:
        if given is not None and given not in self.file.hosts and ("hosts",) not in self.sound.taken:
            known = ", ".join(self.file.hosts) or "none"
            self.wrong(("tasks", name, "host"), f"no host {given!r}{suggest(given, self.file.hosts)}; hosts: {known}")
        return self.hosts.of[name]

    def _task(self, name: str, spec: TaskFile) -> TaskPlan | None:
        if not is_name(name):
            self.wrong(("tasks", name), f"task name must be letters, digits, _ and -, from a letter on, got {name!r}")
        if spec.process is not None and not is_name(spec.process):
            self.wrong(("tasks", name, "process"), f"must be letters, digits, _ and -, got {spec.process!r}")
        host = self._host(name, spec.host)
        if spec.type == UNSOUND:
            return None
        try:
            self.types[name] = cls = task_type(spec.type)
        except ValueError as error:
            self.wrong(("tasks", name, "type"), f"{spec.type!r} {error}")
            return None
        properties = self._properties(name, spec, cls)
        activity = self._activity(name, spec.activity, cls)
        return TaskPlan(name, spec.type, spec.process or name, properties, activity, host)

    def _properties(self, name: str, spec: TaskFile, cls: type[Task]) -> dict[str, Any]:
        if self.sound.lacks("tasks", name, "properties"):
            return {}
        try:
            certain = not self.sound.lacks("tasks", name, "config")
            return task_properties(self.document, name, spec.config, cls, certain)
        except SettingsErrors as errors:
            self.errors += errors.errors
            return {}

    def _activity(self, name: str, given: ActivityFile | None, cls: type[Task]) -> dict[str, Any]:
        if given is None:
            return activity_values(cls.activity)
        inputs = [port for port, declared in ports_of(cls).items() if isinstance(declared, InputPort)]
        for index, port in enumerate(given.port_driven or []):
            if port not in inputs:
                place: KeyPath = ("tasks", name, "activity", "port_driven", index)
                self.wrong(place, f"{name} has no input port {port!r}{suggest(port, inputs)}; it has: {_list(inputs)}")
        return {key: value for key, value in given if value is not None}

    def _connections(self) -> list[ConnectionPlan]:
        found: list[ConnectionPlan] = []
        for index, spec in enumerate(self.file.connections):
            source = self._port(("connections", index, "from"), spec.source, OutputPort)
            for number, name in enumerate(spec.to):
                place: KeyPath = ("connections", index, "to", number)
                target = self._port(place, name, InputPort)
                if source and target and source.sample_type is not target.sample_type:
                    ours, theirs = source.sample_type.__name__, target.sample_type.__name__
                    self.wrong(place, f"{name} takes {theirs}, but {spec.source} gives {ours}")
                if any((c.source, c.target) == (spec.source, name) for c in found):
                    self.wrong(place, f"{spec.source} is connected to {name} already")
                found.append(_connection(spec, name))
        return found

    def _port(self, place: KeyPath, text: str, kind: type[Any]) -> Any:
        task, dot, port = text.partition(".")
        side = "output" if kind is OutputPort else "input"
        if text == UNSOUND:
            self.unclear |= set(self.types)
        elif not dot:
            self.wrong(place, f"must be task.port, got {text!r}")
        elif task not in self.file.tasks:
            self.wrong(place, f"no task {task!r}{suggest(task, self.file.tasks)}")
        elif task in self.types:
            ports = ports_of(self.types[task])
            fitting = [name for name, declared in ports.items() if isinstance(declared, kind)]
            if port in fitting:
                return ports[port]
            other = f"; {port} is an {'input' if side == 'output' else 'output'}" if port in ports else ""
            message = f"{task} has no {side} port {port!r}{other}{suggest(port, fitting)}; it has: {_list(fitting)}"
            self.wrong(place, message)
        else:
            return None
        if kind is InputPort:
            self.unclear.add(task if task in self.file.tasks else port)
        return None

    def _automatic(self, connections: list[ConnectionPlan]) -> list[ConnectionPlan]:
        connected, found = {connection.target for connection in connections}, []
        for task, name, port in self._declared(InputPort):
            if not port.automatic or f"{task}.{name}" in connected:
                continue
            sources = [f"{t}.{n}" for t, n, p in self._declared(OutputPort) if p.sample_type is port.sample_type]
            if len(sources) == 1:
                found.append(ConnectionPlan(sources[0], f"{task}.{name}"))
        return found

    def _declared(self, kind: type[Any]) -> list[tuple[str, str, Any]]:
        every = [(task, name, port) for task, cls in self.types.items() for name, port in ports_of(cls).items()]
        return [(task, name, port) for task, name, port in every if isinstance(port, kind)]

    def _required(self, connections: list[ConnectionPlan]) -> None:
        connected = {connection.target for connection in connections}
        certain = len(self.types) == len(
            self.file.tasks
        )  # a task of an unknown type may be what one connects itself to
        for task, name, port in self._declared(InputPort):
            if {task, name} & self.unclear or self.sound.lacks("connections") or (port.automatic and not certain):
                continue
            if port.required and f"{task}.{name}" not in connected:
                self.wrong(("tasks", task), f"input port {name} ({port.sample_type.__name__}) must be connected")

    def _slaves(self, tasks: list[TaskPlan]) -> None:
        masters = {name: spec.activity.slave for name, spec in self.file.tasks.items() if spec.activity}
        masters |= {task.name: task.activity.get("slave") for task in tasks}
        for name in masters:
            seen, current = {name}, name
            while (master := masters.get(current)) is not None:
                wrong = self._wrong_master(current, master, seen)
                if wrong:
                    self.wrong(("tasks", name, "activity", "slave"), wrong)
                if wrong or master not in self.file.tasks:
                    break
                seen.add(master)
                current = master

    def _wrong_master(self, slave: str, master: str, seen: set[str]) -> str:
        tasks = self.file.tasks
        if master not in tasks:
            return f"no task {master!r}{suggest(master, tasks)}"
        ours, theirs = tasks[slave].process or slave, tasks[master].process or master
        unknown = any(self.sound.lacks("tasks", name, "process") for name in (slave, master))
        if ours != theirs and not unknown:
            return f"{master} must be in the same process: write process: {theirs}"
        return "is a circle: no task in it has a thread of its own" if master in seen else ""

    def _restart(self, task: TaskPlan) -> RestartPlan:
        """A process follows the strictest wish of its tasks: the last one that says something."""
        rules = dict(self.file.defaults)
        for spec in (s for name, s in self.file.tasks.items() if (s.process or name) == task.process):
            rules |= {key: value for key in rules if (value := getattr(spec, key)) is not None}
        return RestartPlan(**rules)


def activity_values(activity: Activity) -> dict[str, Any]:
    """An activity as it would stand in a file."""
    if isinstance(activity, Periodic):
        return {"periodic": activity.period}
    if isinstance(activity, PortDriven):
        values: dict[str, Any] = {"port_driven": list(activity.ports)}
        return values if activity.timeout is None else {**values, "timeout": activity.timeout}
    return {"slave": activity.master}


def _connection(spec: ConnectionFile, target: str) -> ConnectionPlan:
    policy = Policy.of(spec.policy.kind, spec.policy.size, spec.policy.init)
    return ConnectionPlan(spec.source, target, policy.kind, policy.size, policy.init, spec.max_age)


def _name_of(file: Path) -> str:
    stem = "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in file.stem)
    return stem if stem[:1].isalpha() else f"d_{stem}"


def _list(names: list[str]) -> str:
    return ", ".join(names) or "none"
