"""Where a running task is asked and where its ports are read: here, or on another host of a deployment.

Here the run directory tells. Another host is reached through the deployment file, which both sides have: it fixes the
TCP addresses, of ports that hosts share and of each process's control socket, and names the keys. A name server that
knows what runs where was the alternative: one more thing to start, to trust and to go stale.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from sonar_component.middleware.deployment.plan import Plan, TaskPlan
from sonar_component.middleware.rundir import Instance, find_task
from sonar_component.middleware.transport.control import ControlClient
from sonar_component.middleware.transport.transport import Join, Transport
from sonar_component.settings.errors import SettingsError, suggest

_LOOK = 0.05  # [s], between two looks for a task that is not there yet


@dataclass(frozen=True)
class Place:
    """Where one task is.

    Attributes
    ----------
    record : what its process says of it: task, type, process, pid, ports, and ``control``, where the process is asked.
    join : shows our key there; None where none is asked for.
    host : empty for this one.
    """

    record: dict[str, Any]
    join: Join | None = None
    host: str = ""


@dataclass
class Reach:
    """What a client may say of where a task is.

    Attributes
    ----------
    instance : which, where several run here.
    deployment : file whose hosts are reached.
    key : name of our own pair of keys (``sonar keys new NAME``), for hosts that ask for one; the only pair by default.
    """

    instance: str | None = None
    deployment: str | Path | None = None
    key: str | None = None
    _plan: Plan | None = field(default=None, repr=False)

    def find(self, name: str, timeout: float | None = 5.0) -> Place:
        """The place of a task, ``task`` or ``instance/task``; one that is just starting is waited for.

        Raises
        ------
        SettingsError
            If there is no such task, it does not answer, or a key is missing.
        """
        deadline = None if timeout is None else time.monotonic() + timeout
        while True:
            try:
                return self._look(name, deadline)
            except SettingsError:
                if deadline is not None and time.monotonic() >= deadline:
                    raise
            time.sleep(_LOOK)

    def plan(self) -> Plan:
        """The deployment that was named."""
        from sonar_component.middleware.deployment import check_deployment
        from sonar_component.settings.paths import find_file

        if self._plan is None:
            assert self.deployment is not None
            self._plan = check_deployment(find_file(self.deployment))
        return self._plan

    def _look(self, name: str, deadline: float | None) -> Place:
        if self.deployment is None:
            return Place(find_task(name, self.instance)[1])
        if name not in (names := [task.name for task in self.plan().tasks]):
            raise SettingsError(f"no task {name!r}{suggest(name, names)}; it has: {', '.join(names)}", self.plan().file)
        record = Instance(self.instance or self.plan().name).records().get(name)
        if record is not None:
            return Place(record)
        return self.remote(name, 1e9 if deadline is None else max(0.1, deadline - time.monotonic()))

    def remote(self, name: str, timeout: float) -> Place:
        """The place of a task of the deployment on another host; raises as `find`."""
        task = self.plan().task(name)
        control, join = self.control(task), self.joining(task.host)
        transport = Transport()
        client = ControlClient(transport.context, control, join)
        try:
            record = client.ask("record", timeout, task=name)
        except (TimeoutError, RuntimeError) as error:
            raise SettingsError(f"task {name!r} on host {task.host!r} ({control}): {error}{self._hint(task)}") from None
        finally:
            client.close()
            transport.close()
        for port, entry in record["ports"].items():
            entry["endpoint"] = self.plan().addresses.get(f"{name}.{port}", "")
        return Place({**record, "control": control}, join, task.host)

    def control(self, task: TaskPlan) -> str:
        """The control address of a task's process.

        Raises
        ------
        SettingsError
            If the deployment offers none.
        """
        plan = self.plan()
        if not plan.hosts:
            message = f"task {task.name!r} does not run here, and the file names no hosts where it could"
            raise SettingsError(f"{message}; start it with: sonar run {plan.file}", plan.file)
        control = plan.controls.get(f"{task.host}/{task.process}")
        if control is None:
            message = f"host {task.host!r} can be asked from itself alone: give it a key (sonar keys new {task.host})"
            raise SettingsError(message, plan.file)
        return control

    def joining(self, host: str) -> Join | None:
        """What shows our key to a host; None where it asks for none.

        Raises
        ------
        SettingsError
            If there is no key of ours, or several and none is chosen.
        """
        from sonar_component.middleware.transport.keys import joining, own_names
        from sonar_component.settings.paths import find_file

        server = self.plan().hosts[host]["key"]
        if not server:
            return None
        names = own_names()
        chosen = self.key or next((name for name in names if len(names) == 1 or name in self.plan().hosts), None)
        if chosen is None:
            known = f"you have {', '.join(names)}" if names else "make a pair with: sonar keys new NAME"
            raise SettingsError(f"host {host!r} asks for a key: say which of yours (--key NAME); {known}")
        return joining(chosen, find_file(server, self.plan().file))

    def _hint(self, task: TaskPlan) -> str:
        start = f"; is it running there (sonar run {Path(self.plan().file).name} --host {task.host})"
        keyed = self.plan().hosts[task.host]["key"]
        return start + (", and does it allow our key (there: sonar keys allow FILE)?" if keyed else "?")
