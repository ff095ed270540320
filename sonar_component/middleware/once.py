"""Drive a task with no socket, thread or sleep: for tests, notebooks and anyone who wants to see what a task does."""

from __future__ import annotations

from typing import Any

from sonar_component.middleware.lifecycle import State
from sonar_component.middleware.policy import Mailbox, Policy
from sonar_component.middleware.ports import InputPort, OutputPort, connect_in_process
from sonar_component.middleware.task import Task

_ALL = Policy("buffer", 1 << 20, init=False)  # keeps every sample of one run


def run_once(task: Task, inputs: dict[str, Any] | None = None) -> dict[str, list[Any]]:
    """Configure and start a task if needed, give it samples, update it once.

    Parameters
    ----------
    task : in any state but EXCEPTION and FATAL_ERROR.
    inputs : port name -> sample, or a list of samples.

    Returns
    -------
    dict
        Port name -> samples written, for every output port but ``state``.

    Raises
    ------
    RuntimeError
        If the task cannot be configured or started, or is not running afterwards; the text is its own reason.
    """
    if task.lifecycle.state is State.PRE_OPERATIONAL and not task.configure():
        raise RuntimeError(task.lifecycle.reason)
    earlier = {name: len(port.local) for name, port in task.outputs.items()}
    listeners = {name: _listen(port) for name, port in task.outputs.items() if name != "state"}
    if task.lifecycle.state is State.STOPPED and not task.start():
        raise RuntimeError(task.lifecycle.reason)
    for name, samples in (inputs or {}).items():
        port = task.inputs[name]
        writer: OutputPort[Any] = OutputPort(port.sample_type).own("run_once", name)
        connect_in_process(writer, port, _ALL)
        for sample in samples if isinstance(samples, list) else [samples]:
            writer.write(sample)
    task.cycle()
    for name, output in task.outputs.items():
        del output.local[earlier[name] :]
    for port in task.inputs.values():
        port.connections[:] = [c for c in port.connections if not c.source.startswith("run_once.")]
    if task.lifecycle.state is not State.RUNNING:
        raise RuntimeError(f"{task.lifecycle.state.value}: {task.lifecycle.reason}")
    return {name: [r.sample for r in iter(mailbox.take, None)] for name, mailbox in listeners.items()}


def _listen(port: OutputPort[Any]) -> Mailbox:
    reader: InputPort[Any] = InputPort(port.sample_type).own("run_once", port.name)
    return connect_in_process(port, reader, _ALL).mailbox
