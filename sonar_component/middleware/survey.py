"""What runs now: every task of every instance with its state."""

from __future__ import annotations

from typing import Any

from sonar_component.middleware.rundir import instances
from sonar_component.middleware.transport.control import ControlClient
from sonar_component.middleware.transport.transport import Transport

_PATIENCE = 0.5  # [s], for one process to answer


def survey(instance: str | None = None, op: str = "state") -> list[dict[str, Any]]:
    """Ask every running task.

    Parameters
    ----------
    instance : only that one.
    op : ``state`` or ``describe``.

    Returns
    -------
    list of dict
        The record of each task (task, type, process, pid, instance, inputs, outputs) with what it answered; state
        ``NO_ANSWER`` for a process that does not answer.
    """
    chosen = [running for running in instances() if instance in (None, running.name)]
    records = [(running.name, record) for running in chosen for record in running.records().values()]
    transport = Transport()
    try:
        return [{**_entry(name, record), **_ask(transport, record, op)} for name, record in records]
    finally:
        transport.close()


def _entry(instance: str, record: dict[str, Any]) -> dict[str, Any]:
    def ports(direction: str) -> list[dict[str, Any]]:
        chosen = [(name, port) for name, port in record["ports"].items() if port["direction"] == direction]
        return [{"port": f"{record['task']}.{name}", "type": port["type"]} for name, port in chosen]

    keys = ("task", "type", "process", "pid", "started")
    return {"instance": instance, **{key: record[key] for key in keys}, "outputs": ports("out"), "inputs": ports("in")}


def _ask(transport: Transport, record: dict[str, Any], op: str) -> dict[str, Any]:
    client = ControlClient(transport.context, record["control"])
    try:
        answer = client.ask(op, _PATIENCE, task=record["task"])
        return {"description": answer, **_brief(answer)} if op == "describe" else _brief(answer)
    except (TimeoutError, RuntimeError) as error:
        return {"state": "NO_ANSWER", "substate": "", "reason": str(error)}
    finally:
        client.close()


def _brief(answer: dict[str, Any]) -> dict[str, Any]:
    return {key: answer[key] for key in ("state", "substate", "reason")}
