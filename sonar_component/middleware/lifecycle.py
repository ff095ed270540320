"""RTT's life cycle as a table, and the small machine that walks it.

    (state, command)                -> (hook, state if the hook returned true, state if it returned false)

A hook that raises leads to EXCEPTION from anywhere: ``stop_hook`` if the task was running, ``cleanup_hook`` if it was
configured, then ``exception_hook``; if one of those raises too, FATAL_ERROR, which only a restart of the process ends.
Read in rtt/base/TaskCore.cpp; state names as orocos.rb prints them.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from enum import Enum
from typing import Any, NamedTuple, Protocol


class State(Enum):
    """The states of a task."""

    INIT = "INIT"
    PRE_OPERATIONAL = "PRE_OPERATIONAL"
    STOPPED = "STOPPED"
    RUNNING = "RUNNING"
    RUNTIME_ERROR = "RUNTIME_ERROR"
    EXCEPTION = "EXCEPTION"
    FATAL_ERROR = "FATAL_ERROR"


class Command(Enum):
    """What may be asked of a task."""

    CONFIGURE = "configure"
    START = "start"
    STOP = "stop"
    CLEANUP = "cleanup"
    ERROR = "error"
    RECOVER = "recover"
    EXCEPTION = "exception"
    FATAL = "fatal"


class Transition(NamedTuple):
    """What a command does in a state; ``hook`` is empty where nothing is called."""

    hook: str
    done: State
    refused: State


S, C = State, Command
TABLE: dict[tuple[State, Command], Transition] = {
    (S.PRE_OPERATIONAL, C.CONFIGURE): Transition("configure_hook", S.STOPPED, S.PRE_OPERATIONAL),
    (S.STOPPED, C.CONFIGURE): Transition("configure_hook", S.STOPPED, S.PRE_OPERATIONAL),
    (S.STOPPED, C.START): Transition("start_hook", S.RUNNING, S.STOPPED),
    (S.STOPPED, C.CLEANUP): Transition("cleanup_hook", S.PRE_OPERATIONAL, S.PRE_OPERATIONAL),
    (S.RUNNING, C.STOP): Transition("stop_hook", S.STOPPED, S.STOPPED),
    (S.RUNTIME_ERROR, C.STOP): Transition("stop_hook", S.STOPPED, S.STOPPED),
    (S.RUNNING, C.ERROR): Transition("", S.RUNTIME_ERROR, S.RUNNING),
    (S.RUNTIME_ERROR, C.ERROR): Transition("", S.RUNTIME_ERROR, S.RUNTIME_ERROR),
    (S.RUNTIME_ERROR, C.RECOVER): Transition("", S.RUNNING, S.RUNTIME_ERROR),
    (S.EXCEPTION, C.RECOVER): Transition("", S.PRE_OPERATIONAL, S.EXCEPTION),
}
_RUNNING = (S.RUNNING, S.RUNTIME_ERROR)
_CONFIGURED = (S.STOPPED, *_RUNNING)


class Hooks(Protocol):
    """What the machine calls; a hook returns False to refuse, anything else to go on."""

    def configure_hook(self) -> bool | None: ...  # noqa: D102
    def start_hook(self) -> bool | None: ...  # noqa: D102
    def stop_hook(self) -> None: ...  # noqa: D102
    def cleanup_hook(self) -> None: ...  # noqa: D102
    def exception_hook(self) -> None: ...  # noqa: D102


class CommandRefused(RuntimeError):
    """A command that the table does not have in this state."""


class LifeCycle:
    """The state of one task, its reason, and what the task is on the way to.

    Attributes
    ----------
    state, target : equal except while a hook runs.
    substate, reason : a name the task gave to what it is doing, and why, in words.
    hook : the one that runs now, and since when [s, monotonic].
    """

    def __init__(self, hooks: Hooks, on_change: Callable[[LifeCycle], None]) -> None:
        self._hooks, self._on_change = hooks, on_change
        self.state = self.target = State.PRE_OPERATIONAL
        self.substate, self.reason = "", ""
        self.hook: tuple[str, float] | None = None
        self._refusal = ""
        self._error_in_start = ("", "")  # reason and sub-state

    @property
    def running(self) -> bool:
        """True in RUNNING and RUNTIME_ERROR, as RTT's isRunning."""
        return self.state in _RUNNING

    def do(self, command: Command, reason: str = "", substate: str = "") -> bool:
        """Walk the table; True if the command was carried out.

        Raises
        ------
        CommandRefused
            If the table has no such command in this state.
        """
        if command is Command.EXCEPTION:
            self._fail(reason, substate)
            return True
        if command is Command.FATAL:
            self._enter(State.FATAL_ERROR, substate, reason)
            return True
        if command is Command.ERROR and self.target is State.RUNNING and self.state is State.STOPPED:
            self._error_in_start = (reason or "error", substate)  # RTT allows error() inside startHook
            return True
        transition = TABLE.get((self.state, command))
        if transition is None:
            allowed = ", ".join(c.value for s, c in TABLE if s is self.state) or "nothing"
            raise CommandRefused(f"{command.value} is not allowed in {self.state.value}; allowed there: {allowed}")
        return self._walk(transition, reason, substate)

    def _walk(self, transition: Transition, reason: str, substate: str) -> bool:
        before, self.target = self.state, transition.done
        accepted = True
        if transition.hook:
            try:
                accepted = self._call(transition.hook) is not False
            except Exception as error:
                self.state = before
                self._fail(explain(error), "")
                return False
            if self.state is not before:  # RTT: a hook that changes the state itself is a programming error
                self._fail(f"{transition.hook} changed the state itself", "")
                return False
        refusal, self._refusal = self._refusal, ""
        (at_once, its_substate), self._error_in_start = self._error_in_start, ("", "")
        if not accepted:
            self._enter(transition.refused, "", refusal or f"{transition.hook} refused")
        else:
            self._enter(transition.done, substate, reason)
            if at_once:
                self._enter(State.RUNTIME_ERROR, its_substate, at_once)
        return accepted

    def _call(self, hook: str) -> Any:
        self.hook = (hook, time.monotonic())
        try:
            return getattr(self._hooks, hook)()
        finally:
            self.hook = None

    def refuse(self, reason: str) -> bool:
        """For a hook: note why it refuses, and return False."""
        self._refusal = reason
        return False

    def _fail(self, reason: str, substate: str) -> None:
        was_running, was_configured = self.state in _RUNNING, self.state in _CONFIGURED
        self.target = State.EXCEPTION
        try:
            if was_running:
                self._call("stop_hook")
            if was_configured:
                self._call("cleanup_hook")
            self._call("exception_hook")
        except Exception as error:
            self._enter(State.FATAL_ERROR, substate, f"{reason}; then, cleaning up: {explain(error)}")
            return
        self._enter(State.EXCEPTION, substate, reason)

    def _enter(self, state: State, substate: str, reason: str) -> None:
        self.state = self.target = state
        self.substate, self.reason = substate, reason
        self._on_change(self)

    def note(self, substate: str, reason: str = "") -> None:
        """Name what the task is doing without changing its state."""
        if (substate, reason) != (self.substate, self.reason):
            self.substate, self.reason = substate, reason
            self._on_change(self)


def explain(error: BaseException) -> str:
    """An exception in words: its message, and its type where the message alone says little."""
    text = str(error)
    return text if isinstance(error, ValueError) and text else f"{type(error).__name__}: {text}".rstrip(": ")
