"""What runs now: every task of every instance here, or of every host of a deployment, with its state."""

from __future__ import annotations

from typing import Any

from sonar_component.middleware.reach import Reach
from sonar_component.middleware.rundir import Instance, instances
from sonar_component.middleware.transport.control import ControlClient
from sonar_component.middleware.transport.transport import Join, Transport

_PATIENCE = 0.5  # [s], for one process to answer
_REMOTE_PATIENCE = 2.0  # [s], for one of another host: a handshake with keys comes first


def survey(reach: Reach | None = None, op: str = "state") -> list[dict[str, Any]]:
    """Ask every running task.

    Parameters
    ----------
    reach : only an instance, or the hosts of a deployment; all instances of this host by default.
    op : ``state`` or ``describe``.

    Returns
    -------
    list of dict
        The record of each task (task, type, process, pid, instance, host, inputs, outputs) with what it answered; state
        ``NO_ANSWER`` for a process that does not answer. ``host`` is empty for a task of this one.
    """
    reach = reach or Reach()
    transport = Transport()
    try:
        if reach.deployment is not None:
            return _of_deployment(transport, reach, op)
        chosen = [running for running in instances() if reach.instance in (None, running.name)]
        records = [(running.name, record) for running in chosen for record in running.records().values()]
        return [_local(transport, name, record, op) for name, record in records]
    finally:
        transport.close()


def _local(transport: Transport, instance: str, record: dict[str, Any], op: str) -> dict[str, Any]:
    return {**_entry(instance, record), **_ask(transport, record["control"], record["task"], op)}


def _of_deployment(transport: Transport, reach: Reach, op: str) -> list[dict[str, Any]]:
    plan = reach.plan()
    name = reach.instance or plan.name
    here = Instance(name).records()
    found: list[dict[str, Any]] = []
    silent: dict[str, dict[str, Any]] = {}
    for task in plan.tasks:
        if task.name in here:
            found.append(_local(transport, name, here[task.name], op))
            continue
        planned = {"task": task.name, "type": task.type, "process": task.process, "pid": 0, "started": 0.0, "ports": {}}
        control, join = reach.control(task), reach.joining(task.host)
        record = silent.get(control) or _ask(transport, control, task.name, "record", join)
        answer = record
        if "reason" in record:
            silent[control] = record  # and so will its other tasks be
        else:
            planned, answer = record, _ask(transport, control, task.name, op, join)
        found.append({**_entry(name, planned, task.host), **answer})
    return found


def _entry(instance: str, record: dict[str, Any], host: str = "") -> dict[str, Any]:
    def ports(direction: str) -> list[dict[str, Any]]:
        chosen = [(name, port) for name, port in record["ports"].items() if port["direction"] == direction]
        return [{"port": f"{record['task']}.{name}", "type": port["type"]} for name, port in chosen]

    entry = {key: record[key] for key in ("task", "type", "process", "pid", "started")}
    return {"instance": instance, "host": host, **entry, "outputs": ports("out"), "inputs": ports("in")}


def _ask(transport: Transport, control: str, task: str, op: str, join: Join | None = None) -> dict[str, Any]:
    client = ControlClient(transport.context, control, join)
    try:
        answer = dict(client.ask(op, _PATIENCE if join is None else _REMOTE_PATIENCE, task=task))
    except (TimeoutError, RuntimeError) as error:
        return {"state": "NO_ANSWER", "substate": "", "reason": str(error)}
    finally:
        client.close()
    if op == "record":
        return answer
    brief = {key: answer[key] for key in ("state", "substate", "reason")}
    return {"description": answer, **brief} if op == "describe" else brief
