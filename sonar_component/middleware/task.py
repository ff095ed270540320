"""A task: properties, ports, operations and hooks under RTT's life cycle.

All hooks of a task run in one thread, its own, so that what belongs to a thread (a GL context) may be made in one hook
and used in another. Hook names are RTT's in Python's spelling; `update_hook` returns nothing and may raise
`InvalidSampleError` (as `InputPort.read` does) to fall into RUNTIME_ERROR until a good sample comes.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from sonar_component.middleware.clock import Clock, WallClock
from sonar_component.middleware.lifecycle import Command, LifeCycle, State, explain
from sonar_component.middleware.ports import InputPort, InvalidSampleError, OutputPort
from sonar_component.settings.errors import suggest
from sonar_component.settings.paths import find_file
from sonar_component.settings.validation import explain as explain_settings

P = TypeVar("P", bound=BaseModel)
STALE_INPUT = "STALE_INPUT"
INVALID_INPUT = "INVALID_INPUT"


class NoProperties(BaseModel):
    """Properties of a task that has none; the base of those that have."""

    # Most models are bases or parts of others: only what is used is compiled, when it is.
    model_config = ConfigDict(extra="forbid", validate_default=True, defer_build=True)


@dataclass(frozen=True)
class Periodic:
    """Update every `period` seconds of data time, on absolute deadlines."""

    period: float


@dataclass(frozen=True)
class PortDriven:
    """Update when a sample arrives on one of `ports` (all if empty), or `timeout` seconds after the last update."""

    ports: tuple[str, ...] = ()
    timeout: float | None = None


@dataclass(frozen=True)
class Slave:
    """Update in the thread of another task of the same process, after each of its updates."""

    master: str


Activity = Periodic | PortDriven | Slave


@dataclass
class TaskState:
    """What the ``state`` port carries: state and sub-state by name, with the reason in words."""

    time: int = 0
    state: str = ""
    substate: str = ""
    reason: str = ""


@dataclass
class Counters:
    """What a task has done: cycles, late ones, and how long they took [s]."""

    cycles: int = 0
    triggers: int = 0
    overruns: int = 0
    timeouts: int = 0
    last_duration: float = 0.0
    longest: float = 0.0
    began: float = 0.0  # [s, monotonic], 0 while no hook runs


class Task:
    """Base of all tasks.

    Class attributes
    ----------------
    Properties : pydantic model of what can be set; ``dynamic`` names those that may change while running.
    activity : default way of being updated; a deployment may state another.
    InputPort and OutputPort attributes declare the ports.
    """

    Properties: ClassVar[type[BaseModel]] = NoProperties
    dynamic: ClassVar[frozenset[str]] = frozenset()
    activity: ClassVar[Activity] = PortDriven()

    state: OutputPort[TaskState] = OutputPort(TaskState, doc="Life cycle: written at each change.")

    def __init__(self, name: str, properties: dict[str, Any] | None = None, *, clock: Clock | None = None,
                 beside: str | Path | None = None) -> None:  # fmt: skip
        self.name, self.clock, self.beside = name, clock or WallClock(), beside
        self.log = logging.getLogger(name)
        self.given: dict[str, Any] = dict(properties or {})
        self.inputs: dict[str, InputPort[Any]] = {}
        self.outputs: dict[str, OutputPort[Any]] = {}
        for port_name, port in ports_of(type(self)).items():
            self._add(port_name, port.own(name, port_name))
        self.counters = Counters()
        self.lifecycle = LifeCycle(self, self._changed)
        self.on_change: Callable[[LifeCycle], None] = lambda lifecycle: None
        self._fault: InputPort[Any] | None = None
        self._doing: tuple[str, float] | None = None
        self.properties: Any = None

    def _add(self, name: str, port: InputPort[Any] | OutputPort[Any]) -> None:
        setattr(self, name, port)
        if isinstance(port, InputPort):
            self.inputs[name] = port
        else:
            self.outputs[name] = port

    # Hooks: what a task fills in.

    def configure_hook(self) -> bool | None:
        """Get ready; return ``self.refuse("why")`` where the settings cannot work."""

    def start_hook(self) -> bool | None:
        """Begin to run."""

    def update_hook(self) -> None:
        """One cycle: read ports, compute, write ports."""

    def error_hook(self) -> None:
        """One cycle in RUNTIME_ERROR; the default goes on as soon as the port at fault has a good new sample."""
        port = self._fault
        if port is None:
            return
        port.drop_invalid()
        if port.peek_valid() and not port.stale(self.now()):
            self.recover()

    def stop_hook(self) -> None:
        """Undo start_hook."""

    def cleanup_hook(self) -> None:
        """Undo configure_hook."""

    def exception_hook(self) -> None:
        """Leave everything safe after a failure."""

    def property_hook(self, name: str, value: Any) -> None:
        """A dynamic property is about to change; raise ValueError to refuse, and the old value stays."""

    def upstream_restarted(self, source: str) -> None:
        """The task behind an input port has begun anew; called from another thread, so only note it."""
        self.log.warning("%s restarted", source)

    @classmethod
    def check(cls, properties: Any, beside: str | Path | None) -> list[tuple[str, str]]:
        """What is wrong with valid-looking properties, without starting anything: (property, message) each.

        For what a model cannot see, such as a file that must be there.
        """
        return []

    # What a task may ask for.

    def now(self) -> int:
        """Data time [us]."""
        return self.clock.now()

    def find_file(self, ref: str | Path) -> Path:
        """Find a file that a property names, beside the deployment first."""
        return find_file(ref, self.beside)

    def refuse(self, reason: str) -> bool:
        """For configure_hook and start_hook: say why, and return False."""
        return self.lifecycle.refuse(reason)

    def error(self, substate: str, reason: str, port: InputPort[Any] | None = None) -> None:
        """Go to RUNTIME_ERROR; with a port, until that port has a good new sample."""
        self._fault = port
        now = self.lifecycle
        if (now.state, now.substate, now.reason) != (State.RUNTIME_ERROR, substate, reason):
            self.lifecycle.do(Command.ERROR, reason, substate)

    def recover(self) -> None:
        """Go on running after an error."""
        self._fault = None
        self.lifecycle.do(Command.RECOVER)

    def note(self, substate: str, reason: str = "") -> None:
        """Name what the task is doing, for the ``state`` port and `sonar list`."""
        self.lifecycle.note(substate, reason)

    # What drives a task.

    def configure(self) -> bool:
        """Check all properties at once, then configure_hook."""
        mistakes = self.read_properties()
        if mistakes and self.lifecycle.state in (State.PRE_OPERATIONAL, State.STOPPED):
            self.lifecycle.state = self.lifecycle.target = State.PRE_OPERATIONAL
            self.lifecycle.note("INVALID_PROPERTIES", "; ".join(mistakes))
            return False
        return self.lifecycle.do(Command.CONFIGURE)

    def start(self) -> bool:
        """Begin to run; buffers of input ports are emptied, as in Rock."""
        for port in self.inputs.values():
            port.clear()
        return self.lifecycle.do(Command.START)

    def stop(self) -> bool:
        """Stop running."""
        return self.lifecycle.do(Command.STOP)

    def cleanup(self) -> bool:
        """Give back what configure took."""
        return self.lifecycle.do(Command.CLEANUP)

    def cycle(self) -> None:
        """One update: the error hook in RUNTIME_ERROR, the update hook in RUNNING, also just after a recovery."""
        self.counters.cycles += 1
        self._doing = ("update_hook" if self.lifecycle.state is State.RUNNING else "error_hook", time.monotonic())
        try:
            if self.lifecycle.state is State.RUNTIME_ERROR:
                self.error_hook()
            if self.lifecycle.state is State.RUNNING and not self._stale():
                self.update_hook()
        except InvalidSampleError as error:
            self.error(INVALID_INPUT, str(error), self.inputs.get(error.port.rpartition(".")[2]))
        except Exception as error:
            self.log.exception("update failed")
            self.lifecycle.do(Command.EXCEPTION, explain(error))
        finally:
            self._doing = None

    @property
    def doing(self) -> tuple[str, float] | None:
        """The hook or operation that runs now, and since when [s, monotonic]; None between two."""
        return self.lifecycle.hook or self._doing

    @contextmanager
    def within(self, what: str) -> Iterator[None]:
        """Note what runs, for those who wonder why the task does not answer."""
        before, self._doing = self._doing, (what, time.monotonic())
        try:
            yield
        finally:
            self._doing = before

    def watch(self) -> None:
        """Look for stale inputs without an update: for a task that waits and nothing comes."""
        if self.lifecycle.state is State.RUNNING:
            self._stale()

    def _stale(self) -> bool:
        for port in self.inputs.values():
            reason = port.stale(self.now())
            if reason:
                self.error(STALE_INPUT, reason, port)
                return True
        return False

    def read_properties(self) -> list[str]:
        """Build ``properties`` from what was given; every mistake in words."""
        try:
            self.properties = self.Properties.model_validate(self.given)
        except ValidationError as error:
            return wrong_properties(self.Properties, self.given, error)
        return []

    def set_property(self, name: str, value: Any) -> None:
        """Change a property.

        Raises
        ------
        ValueError
            If there is no such property, it is not dynamic and the task is configured, or the value is refused; the old
            value stays.
        """
        fields = self.Properties.model_fields
        if name not in fields:
            raise ValueError(f"{self.name} has no property {name!r}{suggest(name, fields)}")
        configured = self.lifecycle.state not in (State.PRE_OPERATIONAL, State.INIT)
        if configured and name not in self.dynamic:
            raise ValueError(f"{self.name}.{name} cannot change while the task is configured: clean it up first")
        values = {**self.given, name: value}
        try:
            changed = self.Properties.model_validate(values)
        except ValidationError as error:
            raise ValueError("; ".join(wrong_properties(self.Properties, values, error))) from None
        if configured:
            with self.within(f"property_hook of {name}"):
                self.property_hook(name, getattr(changed, name))
        self.given, self.properties = values, changed

    def _changed(self, lifecycle: LifeCycle) -> None:
        self.state.write(TaskState(self.now(), lifecycle.state.value, lifecycle.substate, lifecycle.reason))
        self.on_change(lifecycle)


def ports_of(task_class: type) -> dict[str, InputPort[Any] | OutputPort[Any]]:
    """Name -> port declaration of a task class and its bases."""
    found: dict[str, InputPort[Any] | OutputPort[Any]] = {}
    for cls in reversed(task_class.__mro__):
        found.update({name: value for name, value in vars(cls).items() if isinstance(value, (InputPort, OutputPort))})
    return found


def wrong_properties(model: type[BaseModel], values: dict[str, Any], error: ValidationError) -> list[str]:
    """What is wrong with properties, in words: ``name: what is allowed, what was got``."""
    mistakes = explain_settings(model, values, error.errors())
    return [": ".join(part for part in (".".join(map(str, place)), words) if part) for place, words in mistakes]
