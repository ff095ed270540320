from __future__ import annotations

import itertools

import pytest

from sonar_component.middleware.lifecycle import TABLE, Command, CommandRefused, LifeCycle, State

ORDINARY = [c for c in Command if c not in (Command.EXCEPTION, Command.FATAL)]


class Hooks:
    """Hooks that note their calls and do as told."""

    def __init__(self) -> None:
        self.called: list[str] = []
        self.refuse: set[str] = set()
        self.fail: set[str] = set()

    def _hook(self, name: str) -> bool | None:
        self.called.append(name)
        if name in self.fail:
            raise RuntimeError(f"{name} failed")
        return name not in self.refuse

    def configure_hook(self) -> bool | None:
        return self._hook("configure_hook")

    def start_hook(self) -> bool | None:
        return self._hook("start_hook")

    def stop_hook(self) -> None:
        self._hook("stop_hook")

    def cleanup_hook(self) -> None:
        self._hook("cleanup_hook")

    def exception_hook(self) -> None:
        self._hook("exception_hook")


def machine(state: State) -> tuple[LifeCycle, Hooks]:
    hooks = Hooks()
    lifecycle = LifeCycle(hooks, lambda _: None)
    lifecycle.state = lifecycle.target = state
    return lifecycle, hooks


@pytest.mark.parametrize(("state", "command"), TABLE, ids=lambda value: value.name)
def test_each_row_of_the_table_calls_its_hook_and_ends_in_its_state(state: State, command: Command) -> None:
    lifecycle, hooks = machine(state)
    row = TABLE[state, command]
    assert lifecycle.do(command)
    assert hooks.called == ([row.hook] if row.hook else [])
    assert lifecycle.state is row.done


PAIRS = [pair for pair in itertools.product(State, ORDINARY) if pair not in TABLE]


@pytest.mark.parametrize(("state", "command"), PAIRS, ids=lambda value: value.name)
def test_every_pair_that_is_not_in_the_table_is_refused(state: State, command: Command) -> None:
    lifecycle, hooks = machine(state)
    with pytest.raises(CommandRefused, match=f"{command.value} is not allowed in {state.value}"):
        lifecycle.do(command)
    assert (lifecycle.state, hooks.called) == (state, [])


def test_the_table_is_that_of_rtt() -> None:
    # rtt/base/TaskCore.cpp: configure() from PreOperational and Stopped, start() and cleanup() from Stopped only.
    rows = {(s.name, c.name): row.done.name for (s, c), row in TABLE.items()}
    assert rows == {
        ("PRE_OPERATIONAL", "CONFIGURE"): "STOPPED", ("STOPPED", "CONFIGURE"): "STOPPED",
        ("STOPPED", "START"): "RUNNING", ("STOPPED", "CLEANUP"): "PRE_OPERATIONAL",
        ("RUNNING", "STOP"): "STOPPED", ("RUNTIME_ERROR", "STOP"): "STOPPED",
        ("RUNNING", "ERROR"): "RUNTIME_ERROR", ("RUNTIME_ERROR", "ERROR"): "RUNTIME_ERROR",
        ("RUNTIME_ERROR", "RECOVER"): "RUNNING", ("EXCEPTION", "RECOVER"): "PRE_OPERATIONAL",
    }  # fmt: skip


@pytest.mark.parametrize("command", [Command.CONFIGURE, Command.START])
def test_a_hook_that_returns_false_refuses(command: Command) -> None:
    lifecycle, hooks = machine(State.STOPPED)
    hooks.refuse = {"configure_hook", "start_hook"}
    assert not lifecycle.do(command)
    assert lifecycle.state is TABLE[State.STOPPED, command].refused
    assert lifecycle.reason.endswith("refused")


EXPECTED = {
    State.PRE_OPERATIONAL: ["exception_hook"],
    State.STOPPED: ["cleanup_hook", "exception_hook"],
    State.RUNNING: ["stop_hook", "cleanup_hook", "exception_hook"],
    State.RUNTIME_ERROR: ["stop_hook", "cleanup_hook", "exception_hook"],
}


@pytest.mark.parametrize("state", EXPECTED, ids=lambda value: value.name)
def test_an_exception_undoes_what_was_done(state: State) -> None:
    lifecycle, hooks = machine(state)
    lifecycle.do(Command.EXCEPTION, "sonar head lost")
    assert hooks.called == EXPECTED[state]
    assert (lifecycle.state, lifecycle.reason) == (State.EXCEPTION, "sonar head lost")


@pytest.mark.parametrize("hook", ["stop_hook", "cleanup_hook", "exception_hook"])
def test_failing_while_cleaning_up_is_fatal(hook: str) -> None:
    lifecycle, hooks = machine(State.RUNNING)
    hooks.fail = {hook}
    lifecycle.do(Command.EXCEPTION, "first")
    assert lifecycle.state is State.FATAL_ERROR
    assert lifecycle.reason == f"first; then, cleaning up: RuntimeError: {hook} failed"


@pytest.mark.parametrize(
    ("state", "command", "hook"),
    [
        (State.PRE_OPERATIONAL, Command.CONFIGURE, "configure_hook"),
        (State.STOPPED, Command.START, "start_hook"),
        (State.STOPPED, Command.CLEANUP, "cleanup_hook"),
        (State.RUNNING, Command.STOP, "stop_hook"),
    ],
)
def test_a_hook_that_raises_leads_to_exception_or_fatal(state: State, command: Command, hook: str) -> None:
    lifecycle, hooks = machine(state)
    hooks.fail = {hook}
    assert not lifecycle.do(command)
    again = hook in EXPECTED[state]  # it is called, and raises, once more while cleaning up
    assert lifecycle.state is (State.FATAL_ERROR if again else State.EXCEPTION)
    assert f"{hook} failed" in lifecycle.reason


def test_an_error_inside_start_ends_in_runtime_error() -> None:
    lifecycle, hooks = machine(State.STOPPED)
    hooks.start_hook = lambda: lifecycle.do(Command.ERROR, "no echo")  # type: ignore[method-assign]
    assert lifecycle.do(Command.START)
    assert (lifecycle.state, lifecycle.reason) == (State.RUNTIME_ERROR, "no echo")


def test_the_target_differs_from_the_state_while_a_hook_runs() -> None:
    lifecycle, hooks = machine(State.PRE_OPERATIONAL)
    seen = []
    hooks.configure_hook = lambda: seen.append((lifecycle.state, lifecycle.target))  # type: ignore[method-assign]
    lifecycle.do(Command.CONFIGURE)
    assert seen == [(State.PRE_OPERATIONAL, State.STOPPED)]
    assert lifecycle.target is State.STOPPED


def test_fatal_ends_everything() -> None:
    lifecycle, _ = machine(State.RUNNING)
    lifecycle.do(Command.FATAL, "flooded")
    for command in ORDINARY:
        with pytest.raises(CommandRefused, match="allowed there: nothing"):
            lifecycle.do(command)
