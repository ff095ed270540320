"""Looking at a running graph from another shell: list, echo, hz and their kin. Only the run directory is needed."""

from __future__ import annotations

import itertools
import json
import time
from typing import Any

import typer

from sonar_component.cli.pictures import print_picture
from sonar_component.cli.run import print_json

PORT = typer.Argument(..., metavar="TASK.PORT", help="Output port of a running task.")
JSON = typer.Option(False, "--json", help="Print JSON.")
INSTANCE = typer.Option(None, help="Which instance, where several run.")
TIMEOUT = typer.Option(5.0, min=0.0, help="Seconds to wait for the first sample.")


def register(app: typer.Typer) -> None:
    """Add the verbs."""
    app.command("list")(list_tasks)
    app.command("echo")(echo)
    app.command("hz")(hz)


def list_tasks(as_json: bool = JSON, instance: str | None = INSTANCE) -> None:
    """List running tasks, their states and ports."""
    from sonar_component.middleware.survey import survey

    tasks = survey(instance)
    ports = [port["port"] for task in tasks for port in task["outputs"]]
    if as_json:
        print_json({"tasks": tasks, "ports": ports})
        return
    if not tasks:
        print("nothing is running; start a deployment with: sonar run FILE")
    for task in tasks:
        reason = f": {task['reason']}" if task["reason"] else ""
        where = f"process {task['process']}, pid {task['pid']}, instance {task['instance']}"
        print(f"{task['task']} ({task['type']}) {task['state']}{reason}  [{where}]")
        for port in task["outputs"]:
            print(f"  > {port['port']}  {port['type']}")
        for port in task["inputs"]:
            print(f"  < {port['port']}  {port['type']}")


def echo(
    port: str = PORT,
    count: int | None = typer.Option(None, "--count", "-n", min=1, help="Stop after this many samples."),
    plot: bool = typer.Option(False, "--plot", help="Draw sonar images with characters."),
    as_json: bool = JSON,
    timeout: float = TIMEOUT,
    instance: str | None = INSTANCE,
) -> None:
    """Print samples; of an array its size and statistics, never a million numbers."""
    from sonar_component.middleware.client import connect
    from sonar_component.middleware.summary import as_text, summary

    with connect(port, timeout=timeout, instance=instance) as reader:
        number = 0
        while count is None or number < count:
            sample = _read(reader, timeout)
            fields = summary(sample)
            if as_json:
                print(json.dumps(fields), flush=True)
            else:
                print(f"--- {reader.name} ({reader.type_name})\n{as_text(fields)}", flush=True)
                if plot:
                    print_picture(sample)
            number += 1


def hz(
    port: str = PORT,
    seconds: float = typer.Option(3.0, min=0.1, help="How long to measure."),
    as_json: bool = JSON,
    timeout: float = TIMEOUT,
    instance: str | None = INSTANCE,
) -> None:
    """Measure the rate of a port from the headers of its samples."""
    times, _, account = _headers(port, seconds, timeout, instance)
    intervals = [later - earlier for earlier, later in itertools.pairwise(times)]
    rate = len(intervals) / (times[-1] - times[0]) if intervals else 0.0
    result = {
        "port": port, "hz": rate, "samples": len(times), "lost": account.lost, "restarts": account.restarts,
        "shortest": min(intervals, default=None), "longest": max(intervals, default=None),
    }  # fmt: skip
    if as_json:
        print_json(result)
    elif not intervals:
        print(f"{port}: {len(times)} samples in {seconds:g} s: no rate")
    else:
        shortest, longest = min(intervals) * 1e3, max(intervals) * 1e3
        print(
            f"{port}: {rate:.2f} Hz over {len(times)} samples, {shortest:.1f} to {longest:.1f} ms, lost {account.lost}"
        )


def _headers(port: str, seconds: float, timeout: float, instance: str | None) -> tuple[list[float], list[Any], Any]:
    """Arrival times [s] and headers of what comes within `seconds` of the first sample."""
    from sonar_component.middleware.client import connect

    with connect(
        port,
        policy="circular_buffer",
        size=10_000,
        timeout=timeout,
        instance=instance,
        decoder=lambda header, _: header,
    ) as reader:
        first = _receive(reader, timeout)
        times, headers = [first.arrived], [first.sample]
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            try:
                received = reader.receive(left)
            except TimeoutError:
                break
            times.append(received.arrived)
            headers.append(received.sample)
        return times, headers, reader.account


def _receive(reader: Any, timeout: float) -> Any:
    try:
        return reader.receive(timeout)
    except TimeoutError as error:
        typer.echo(f"{error}; is its task running? see: sonar list", err=True)
        raise typer.Exit(1) from None


def _read(reader: Any, timeout: float) -> Any:
    return _receive(reader, timeout).sample
