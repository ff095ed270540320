"""Every mistake of a deployment, before anything starts.

All names are resolved here, with what the task types declare; the result is a plan that needs no further questions.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sonar_component.middleware.deployment.file import ActivityFile, ConnectionFile, DeploymentFile, TaskFile
from sonar_component.middleware.deployment.overlay import task_properties
from sonar_component.middleware.deployment.plan import ConnectionPlan, Plan, RestartPlan, TaskPlan
from sonar_component.middleware.deployment.task_types import task_type
from sonar_component.middleware.policy import Policy
from sonar_component.middleware.ports import InputPort, OutputPort
from sonar_component.middleware.rundir import is_name
from sonar_component.middleware.task import Activity, Periodic, PortDriven, Task, ports_of
from sonar_component.settings.errors import SettingsError, SettingsErrors, suggest
from sonar_component.settings.loader import Document, KeyPath, load_yaml
from sonar_component.settings.validation import validate

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
    document = load_yaml(path)
    _override(document, overrides or {})
    return _Checker(document, validate(DeploymentFile, document)).plan(name)


def _override(document: Document, overrides: Overrides) -> None:
    tasks = document.at(("tasks",)) or {}
    for task, values in overrides.items():
        if task not in tasks:
            raise SettingsError(f"--set: no task {task!r}{suggest(task, tasks)}; there are: {', '.join(tasks)}")
        tasks[task] = {**tasks[task], "properties": {**(tasks[task].get("properties") or {}), **values}}


class _Checker:
    """Collects mistakes while it resolves."""

    def __init__(self, document: Document, file: DeploymentFile) -> None:
        self.document, self.file = document, file
        self.errors: list[SettingsError] = []
        self.types: dict[str, type[Task]] = {}

    def wrong(self, path: KeyPath, message: str) -> None:
        self.errors.append(self.document.error(path, message))

    def plan(self, name: str | None) -> Plan:
        name = name or self.file.name or _name_of(Path(self.document.file))
        if not is_name(name):
            self.wrong(("name",), f"must be letters, digits, _ and -, from a letter on, got {name!r}")
        tasks = [task for key, spec in self.file.tasks.items() if (task := self._task(key, spec)) is not None]
        connections = self._connections()
        connections += self._automatic(connections)
        if len(self.types) == len(self.file.tasks):  # else it would only be told what follows from a wrong type
            self._required(connections)
        self._slaves(tasks)
        if self.errors:
            raise SettingsErrors(sorted(self.errors, key=lambda error: (error.line or 0, error.column or 0)))
        if self.file.clock.mode == "sim" and len({task.host for task in tasks}) > 1:
            self.wrong(("clock", "mode"), "sim needs all tasks on one host: no clock is shared between hosts")
        addresses = self._addresses(tasks, connections)
        controls = self._controls(tasks, addresses)
        self._no_clash({**addresses, **controls})
        if self.errors:
            raise SettingsErrors(self.errors)
        hosts = {key: dict(host) for key, host in self.file.hosts.items()}
        restart = {task.process: self._restart(task) for task in tasks}
        clock = dict(self.file.clock)
        file = str(Path(self.document.file).resolve())
        return Plan(name, file, tasks, connections, clock, restart, addresses, controls, hosts, self._is_open())

    def _addresses(self, tasks: list[TaskPlan], connections: list[ConnectionPlan]) -> dict[str, str]:
        """TCP addresses of the ports that are read from another host, counted from the host's first port."""
        host_of = {task.name: task.host for task in tasks}
        found: dict[str, str] = {}
        used: dict[str, int] = {}
        for index, connection in enumerate(connections):
            writer, reader = (host_of[end.partition(".")[0]] for end in (connection.source, connection.target))
            if writer == reader or connection.source in found:
                continue
            if connection.policy == "reliable":
                self.wrong(("connections", index), "a reliable connection must stay on one host")
            self._guarded(writer)
            host = self.file.hosts[writer]
            found[connection.source] = f"tcp://{host.address}:{host.port + used.get(writer, 0)}"
            used[writer] = used.get(writer, 0) + 1
        return found

    def _controls(self, tasks: list[TaskPlan], addresses: dict[str, str]) -> dict[str, str]:
        """TCP addresses at which processes are asked from other hosts: after those of the host's ports.

        A host that may not open any, since others could reach it and it has no key, is asked from itself alone.
        """
        host_of = {task.name: task.host for task in tasks}
        used = [host_of[port.partition(".")[0]] for port in addresses]
        found: dict[str, str] = {}
        for name, host in self.file.hosts.items():
            processes = dict.fromkeys(task.process for task in tasks if task.host == name)
            if self._may_open(name):
                numbered = enumerate(processes, host.port + used.count(name))
                found |= {f"{name}/{process}": f"tcp://{host.address}:{number}" for number, process in numbered}
        return found

    def _no_clash(self, addresses: dict[str, str]) -> None:
        """Two hosts on one machine, as in a rehearsal, must not count through the same TCP ports."""
        owners: dict[str, str] = {}
        for owner, address in addresses.items():
            first = owners.setdefault(address, owner)
            if first != owner:
                host = owner.partition("/")[0] if "/" in owner else self._host_of(owner)
                self.wrong(("hosts", host), f"{address} is taken by {first}: give this host another port or address")
                return

    def _host_of(self, port: str) -> str:
        return self.file.tasks[port.partition(".")[0]].host or next(iter(self.file.hosts))

    def _may_open(self, name: str) -> bool:
        host = self.file.hosts[name]
        return host.is_loopback or host.key is not None or self.file.insecure

    def _is_open(self) -> bool:
        """Whether others can read and ask without keys: what the file allows, and an address that they can reach."""
        return self.file.insecure and any(h.key is None and not h.is_loopback for h in self.file.hosts.values())

    def _guarded(self, name: str) -> None:
        """An address that others can reach needs a key, or a word that none is wanted."""
        if not self._may_open(name):
            address = self.file.hosts[name].address
            message = f"address {address} can be reached by others: give key (sonar keys new {name}), or insecure: true"
            self.wrong(("hosts", name), message)

    def _host(self, name: str, given: str | None) -> str:
        if given is not None and given not in self.file.hosts:
            known = ", ".join(self.file.hosts) or "none"
            self.wrong(("tasks", name, "host"), f"no host {given!r}{suggest(given, self.file.hosts)}; hosts: {known}")
        return given or next(iter(self.file.hosts), "")

    def _task(self, name: str, spec: TaskFile) -> TaskPlan | None:
        if not is_name(name):
            self.wrong(("tasks", name), f"task name must be letters, digits, _ and -, from a letter on, got {name!r}")
        if spec.process is not None and not is_name(spec.process):
            self.wrong(("tasks", name, "process"), f"must be letters, digits, _ and -, got {spec.process!r}")
        try:
            self.types[name] = cls = task_type(spec.type)
        except ValueError as error:
            self.wrong(("tasks", name, "type"), f"{spec.type!r} {error}")
            return None
        properties: dict[str, Any] = {}
        try:
            properties = task_properties(self.document, name, spec.config, cls)
        except SettingsErrors as errors:
            self.errors += errors.errors
        except SettingsError as error:
            self.errors.append(error)
        activity = self._activity(name, spec.activity, cls)
        host = self._host(name, spec.host)
        return TaskPlan(name, spec.type, spec.process or name, properties, activity, host)

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
        if not dot:
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
        for task, name, port in self._declared(InputPort):
            if port.required and f"{task}.{name}" not in connected:
                self.wrong(("tasks", task), f"input port {name} ({port.sample_type.__name__}) must be connected")

    def _slaves(self, tasks: list[TaskPlan]) -> None:
        by_name = {task.name: task for task in tasks}
        for task in tasks:
            seen, current = {task.name}, task
            while (master := current.activity.get("slave")) is not None:
                place: KeyPath = ("tasks", task.name, "activity", "slave")
                if master not in by_name:
                    self.wrong(place, f"no task {master!r}{suggest(master, by_name)}")
                    break
                if by_name[master].process != current.process:
                    self.wrong(place, f"{master} must be in the same process: write process: {by_name[master].process}")
                    break
                if master in seen:
                    self.wrong(place, "is a circle: no task in it has a thread of its own")
                    break
                seen.add(master)
                current = by_name[master]

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
