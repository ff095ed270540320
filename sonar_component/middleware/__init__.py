"""The port graph: tasks with Rock's life cycle, typed ports over ZeroMQ, deployments. It knows nothing of sonar."""

from sonar_component.middleware.once import run_once
from sonar_component.middleware.operations import operation
from sonar_component.middleware.policy import FlowStatus, Policy, WriteStatus
from sonar_component.middleware.ports import InputPort, InvalidSampleError, OutputPort
from sonar_component.middleware.task import NoProperties, Periodic, PortDriven, Slave, Task

__all__ = [
    "FlowStatus", "InputPort", "InvalidSampleError", "NoProperties", "OutputPort", "Periodic", "Policy", "PortDriven",
    "Slave", "Task", "WriteStatus", "operation", "run_once",
]  # fmt: skip
