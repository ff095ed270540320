"""Asking running tasks: inspect, get, set, call, state, and the graph of them all."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import typer

from sonar_component.cli import complete
from sonar_component.cli.ports import DEPLOYMENT, INSTANCE, KEY, Where
from sonar_component.cli.run import parse_value, print_json

TASK = typer.Argument(..., metavar="TASK", help="A running task.", autocompletion=complete.tasks)
PROPERTY = typer.Argument(
    ..., metavar="TASK[.PROPERTY]", help="A property of a running task, or all of them.",
    autocompletion=complete.properties,
)  # fmt: skip
JSON = typer.Option(False, "--json", help="Print JSON.")
_WIDE = 200  # characters of a line that goes to a file
TIMEOUT = typer.Option(2.0, min=0.0, help="Seconds to wait for the answer.")


def register(app: typer.Typer) -> None:
    """Add the verbs."""
    for verb in (inspect, get, state, call, graph, top):
        app.command(verb.__name__)(verb)
    app.command("set")(set_property)


def inspect(
    task: str = TASK,
    as_json: bool = JSON,
    timeout: float = TIMEOUT,
    instance: str | None = INSTANCE,
    deployment: Path | None = DEPLOYMENT,
    key: str | None = KEY,
) -> None:
    """Show all of a task: state, properties, operations, ports, and what became of every sample."""
    with _connect(task, timeout, (instance, deployment, key)) as proxy:
        found = {**proxy.record, **_answer(proxy.describe)}
    for name, port in found["outputs"].items():
        port["endpoint"] = found["ports"][name]["endpoint"]
    if as_json:
        print_json(found)
        return
    print(f"{found['task']} ({found['type']}, process {found['process']}, pid {found['pid']}): {_state_words(found)}")
    counters = found["counters"]
    print(f"  cycles {counters['cycles']}, overruns {counters['overruns']}, longest {counters['longest'] * 1e3:.1f} ms")
    for name, item in found["properties"].items():
        value = item.get("written", item["value"])
        print(f"  property  {name} = {value}{'  (dynamic)' if item['dynamic'] else ''}  {item['doc']}")
    for name, signature in found["operations"].items():
        print(f"  operation {name}{signature}")
    for name, port in found["outputs"].items():
        print(f"  output    {name}: {port['type']}, {port['written']} written, {port['listeners']} listening")
    for name, port in found["inputs"].items():
        print(f"  input     {name}: {port['type']}")
        for line in port["connections"]:
            counts = ", ".join(f"{key} {line[key]}" for key in ("received", "replaced", "dropped", "lost", "restarts"))
            print(f"            from {line['from']} ({line['policy']}): {counts}")
            for reason, count in line["rejected"].items():
                print(f"            refused {count} times: {reason}")


def get(
    name: str = PROPERTY,
    as_json: bool = JSON,
    timeout: float = TIMEOUT,
    instance: str | None = INSTANCE,
    deployment: Path | None = DEPLOYMENT,
    key: str | None = KEY,
) -> None:
    """Print a property, or all properties of a task."""
    task, _, chosen = name.partition(".")
    with _connect(task, timeout, (instance, deployment, key)) as proxy:
        value = _answer(proxy.get, chosen or None)
    if as_json:
        print_json(value)
    elif chosen:
        print(value)
    else:
        for item, entry in value.items():
            print(f"{item} = {entry['value']}")


def set_property(
    name: str = typer.Argument(
        ..., metavar="TASK.PROPERTY", help="A property of a running task.", autocompletion=complete.properties
    ),
    value: str = typer.Argument(..., help='As in YAML: 30 m, 0.5, true, "text".'),
    timeout: float = TIMEOUT,
    instance: str | None = INSTANCE,
    deployment: Path | None = DEPLOYMENT,
    key: str | None = KEY,
) -> None:
    """Set a property of a running task; a refusal says why and changes nothing."""
    task, _, chosen = name.partition(".")
    with _connect(task, timeout, (instance, deployment, key)) as proxy:
        _answer(proxy.set, chosen, parse_value(value))


def call(
    operation: str = typer.Argument(
        ..., metavar="TASK.OPERATION", help="An operation of a running task.", autocompletion=complete.operations
    ),
    arguments: list[str] = typer.Argument(None, metavar="[NAME=VALUE]...", help="Values are written as in YAML."),
    as_json: bool = JSON,
    timeout: float = TIMEOUT,
    instance: str | None = INSTANCE,
    deployment: Path | None = DEPLOYMENT,
    key: str | None = KEY,
) -> None:
    """Call an operation of a running task."""
    from sonar_component.settings.errors import SettingsError

    task, _, chosen = operation.partition(".")
    given = {}
    for text in arguments or []:
        name, equals, value = text.partition("=")
        if not equals:
            raise SettingsError(f"arguments must be NAME=VALUE, got {text!r}")
        given[name] = parse_value(value)
    with _connect(task, timeout, (instance, deployment, key)) as proxy:
        result = _answer(proxy.call, chosen, **given)
    if as_json:
        print_json(result)
    elif result is not None:
        print(result)


def state(
    task: str = TASK,
    command: str | None = typer.Argument(
        None, help=f"{', '.join(complete.COMMANDS)}.", autocompletion=complete.commands
    ),
    as_json: bool = JSON,
    timeout: float = TIMEOUT,
    instance: str | None = INSTANCE,
    deployment: Path | None = DEPLOYMENT,
    key: str | None = KEY,
) -> None:
    """Print a task's state, or order it into another."""
    with _connect(task, timeout, (instance, deployment, key)) as proxy:
        found = _answer(proxy.command, command) if command else _answer(proxy.state)
    if as_json:
        print_json(found)
    else:
        print(f"{found['task']}: {_state_words(found)}")
    if command and not found["done"]:
        raise typer.Exit(1)


def graph(
    file: Path | None = typer.Argument(None, help="A deployment; without it, what runs now."),
    out: Path | None = typer.Option(None, help="Write an SVG picture."),
    seconds: float = typer.Option(1.0, min=0.1, help="How long to measure rates."),
    as_json: bool = JSON,
    instance: str | None = INSTANCE,
    deployment: Path | None = DEPLOYMENT,
    key: str | None = KEY,
) -> None:
    """Show tasks and connections: of a file, or of what runs, with rates and losses on the edges."""
    from sonar_component.middleware import graph as graphs

    if file is not None:
        from sonar_component.middleware.deployment import check_deployment
        from sonar_component.settings.paths import find_file

        plan = check_deployment(find_file(file))
        found, title = graphs.of_plan(plan), plan.name
    else:
        from sonar_component.middleware.reach import Reach
        from sonar_component.middleware.survey import survey

        reach = Reach(instance, deployment, key)
        before, began = survey(reach, "describe"), time.monotonic()
        time.sleep(seconds)
        after = survey(reach, "describe")
        found, title = graphs.of_running(before, after, time.monotonic() - began), time.strftime("%H:%M:%S")
    if out is not None:
        out.write_text(graphs.as_svg(found, title), encoding="utf-8")
    if as_json:
        print_json({"tasks": found.nodes, "connections": found.edges})
    elif out is None:
        print(graphs.as_text(found) or "nothing is running")


def top(
    once: bool = typer.Option(False, help="Print one table and end."),
    seconds: float = typer.Option(1.0, min=0.1, help="Between two looks."),
    as_json: bool = JSON,
    instance: str | None = INSTANCE,
    deployment: Path | None = DEPLOYMENT,
    key: str | None = KEY,
) -> None:
    """Show what each task costs: cycles, overruns, processor, memory, losses."""
    from sonar_component.middleware.load import Load
    from sonar_component.middleware.reach import Reach

    load = Load(Reach(instance, deployment, key))
    while True:
        time.sleep(seconds)
        rows = load.look()
        if as_json:
            print_json(rows)
        else:
            _print_table(rows, clear=not once)
        if once or as_json:
            return


def _print_table(rows: list[dict[str, Any]], clear: bool) -> None:
    from rich.console import Console
    from rich.table import Table

    numbers = {
        "rate": "cycles/s", "overruns": "overruns", "longest_ms": "longest ms", "cpu": "cpu %",
        "memory_mb": "memory MB", "lost": "lost",
    }  # fmt: skip
    table = Table(box=None, pad_edge=False)
    for head in ("task", "state", *numbers.values(), "reason"):
        right = head in numbers.values()
        table.add_column(head, justify="right" if right else "left", no_wrap=head != "reason")
    for row in rows:
        values = [row[key] for key in numbers]
        words = [str(value) if isinstance(value, int) else f"{value:.1f}" for value in values]
        table.add_row(row["task"], row["state"], *words, row["reason"])
    console = Console()
    if not console.is_terminal:
        console.width = _WIDE
    if clear:
        console.clear()
    console.print(table)


def _state_words(found: dict[str, Any]) -> str:
    substate = f" {found['substate']}" if found["substate"] else ""
    return f"{found['state']}{substate}" + (f": {found['reason']}" if found["reason"] else "")


def _connect(task: str, timeout: float, where: Where) -> Any:
    from sonar_component.middleware.client import connect_task

    instance, deployment, key = where
    return connect_task(task, timeout=timeout, instance=instance, deployment=deployment, keys=key)


def _answer(ask: Any, *arguments: Any, **named: Any) -> Any:
    """The answer; silence or a failure is one line and exit code 1, what is wrong with the question 2."""
    from sonar_component.middleware.transport.control import WrongRequestError

    try:
        return ask(*arguments, **named)
    except (RuntimeError, TimeoutError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(2 if isinstance(error, WrongRequestError) else 1) from None
