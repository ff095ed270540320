"""The port graph: tasks with Rock's life cycle, typed ports over ZeroMQ, deployments. It knows nothing of sonar.

Names are imported when they are first asked for: a child process must tie its life to its launcher before it spends
time on imports, and the command line should start at once.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sonar_component.middleware.client import connect, connect_task
    from sonar_component.middleware.once import run_once
    from sonar_component.middleware.operations import operation
    from sonar_component.middleware.policy import FlowStatus, Policy, WriteStatus
    from sonar_component.middleware.ports import InputPort, InvalidSampleError, OutputPort
    from sonar_component.middleware.proxy import TaskProxy
    from sonar_component.middleware.reader import PortReader
    from sonar_component.middleware.task import NoProperties, Periodic, PortDriven, Slave, Task
    from sonar_component.middleware.writer import PortWriter

_PLACES = {
    "client": ("connect", "connect_task"),
    "once": ("run_once",),
    "operations": ("operation",),
    "policy": ("FlowStatus", "Policy", "WriteStatus"),
    "ports": ("InputPort", "InvalidSampleError", "OutputPort"),
    "proxy": ("TaskProxy",),
    "reader": ("PortReader",),
    "task": ("NoProperties", "Periodic", "PortDriven", "Slave", "Task"),
    "writer": ("PortWriter",),
}

__all__ = [
    "FlowStatus", "InputPort", "InvalidSampleError", "NoProperties", "OutputPort", "Periodic", "Policy", "PortDriven",
    "PortReader", "PortWriter", "Slave", "Task", "TaskProxy", "WriteStatus", "connect", "connect_task", "operation",
    "run_once",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    for module, names in _PLACES.items():
        if name in names:
            return getattr(import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
