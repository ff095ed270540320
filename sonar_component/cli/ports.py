"""Looking at a running graph from another shell: list, echo, hz and their kin. Only the run directory is needed."""

from __future__ import annotations

import itertools
import json
import time
from pathlib import Path
from typing import Any

import typer

from sonar_component.cli import complete
from sonar_component.cli.pictures import print_picture
from sonar_component.cli.run import print_json

PORT = typer.Argument(..., metavar="TASK.PORT", help="Output port of a running task.", autocompletion=complete.outputs)
JSON = typer.Option(False, "--json", help="Print JSON.")
INSTANCE = typer.Option(None, help="Which instance, where several run.")
DEPLOYMENT = typer.Option(None, metavar="FILE", help="Reach tasks of this deployment's other hosts.")
KEY = typer.Option(None, metavar="NAME", help="Which of our pairs of keys to show to another host.")
TIMEOUT = typer.Option(5.0, min=0.0, help="Seconds to wait for the first sample.")
Where = tuple[str | None, Path | None, str | None]  # instance, deployment, key


def register(app: typer.Typer) -> None:
    """Add the verbs."""
    app.command("list")(list_tasks)
    app.command("echo")(echo)
    app.command("hz")(hz)
    app.command("bw")(bw)
    app.command("delay")(delay)


def list_tasks(
    as_json: bool = JSON,
    instance: str | None = INSTANCE,
    deployment: Path | None = DEPLOYMENT,
    key: str | None = KEY,
) -> None:
    """List running tasks, their states and ports."""
    from sonar_component.middleware.reach import Reach
    from sonar_component.middleware.survey import survey

    tasks = survey(Reach(instance, deployment, key))
    ports = [port["port"] for task in tasks for port in task["outputs"]]
    if as_json:
        print_json({"tasks": tasks, "ports": ports})
        return
    if not tasks:
        print("nothing is running; start a deployment with: sonar run FILE")
    for task in tasks:
        reason = f": {task['reason']}" if task["reason"] else ""
        host = f"host {task['host']}, " if task["host"] else ""
        where = f"{host}process {task['process']}, pid {task['pid']}, instance {task['instance']}"
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
    deployment: Path | None = DEPLOYMENT,
    key: str | None = KEY,
) -> None:
    """Print samples; of an array its size and statistics, never a million numbers."""
    from sonar_component.middleware.client import connect
    from sonar_component.middleware.summary import as_text, summary

    with connect(port, timeout=timeout, instance=instance, deployment=deployment, keys=key) as reader:
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
    deployment: Path | None = DEPLOYMENT,
    key: str | None = KEY,
) -> None:
    """Measure the rate of a port from the headers of its samples."""
    times, _, account = _headers(port, seconds, timeout, (instance, deployment, key))
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


def bw(
    port: str = PORT,
    seconds: float = typer.Option(3.0, min=0.1, help="How long to measure."),
    as_json: bool = JSON,
    timeout: float = TIMEOUT,
    instance: str | None = INSTANCE,
    deployment: Path | None = DEPLOYMENT,
    key: str | None = KEY,
) -> None:
    """Measure the bandwidth of a port."""
    times, sizes, account = _headers(port, seconds, timeout, (instance, deployment, key), _size)
    elapsed = times[-1] - times[0]
    rate = sum(sizes[1:]) / elapsed if elapsed else 0.0
    mean = sum(sizes) / len(sizes)
    result = {"port": port, "bytes_per_second": rate, "mean_bytes": mean, "samples": len(sizes), "lost": account.lost}
    if as_json:
        print_json(result)
    else:
        print(f"{port}: {rate / 1e6:.3f} MB/s, {mean / 1e3:.1f} kB a sample, {len(sizes)} samples, lost {account.lost}")


def delay(
    port: str = PORT,
    seconds: float = typer.Option(3.0, min=0.1, help="How long to measure."),
    as_json: bool = JSON,
    timeout: float = TIMEOUT,
    instance: str | None = INSTANCE,
    deployment: Path | None = DEPLOYMENT,
    key: str | None = KEY,
) -> None:
    """Measure how old samples are on arrival: since they were written, and since their data was true."""
    _, pairs, _ = _headers(port, seconds, timeout, (instance, deployment, key), _ages)
    written = sorted(since_written for since_written, _ in pairs)
    ages = sorted(age for _, age in pairs if age is not None)
    transport, age = _spread(written), _spread(ages) if ages else None
    if as_json:
        print_json({"port": port, "samples": len(written), "transport_ms": transport, "age_ms": age})
        return
    print(f"{port}: since written {_spread_words(transport)} over {len(written)} samples")
    if age:
        print(f"{port}: since true    {_spread_words(age)}")


def _size(header: dict[str, Any], buffers: list[Any]) -> int:
    inline = sum(len(entry[3]) for entry in header["arr"] if len(entry) == 4)
    return int(inline + sum(buffer.nbytes for buffer in buffers))


def _ages(header: dict[str, Any], buffers: list[Any]) -> tuple[float, float | None]:
    """Milliseconds since the sample was written, and since its data was true if that is wall time."""
    now = time.time_ns() / 1e3
    return (now - header["tp"]) / 1e3, (now - header["t"]) / 1e3 if header["clk"] == "wall" and header["t"] else None


def _spread(values: list[float]) -> dict[str, float]:
    count = len(values)
    return {"least": values[0], "median": values[count // 2], "p99": values[int(count * 0.99)], "most": values[-1]}


def _spread_words(spread: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.2f} ms" for name, value in spread.items())


def _headers(
    port: str, seconds: float, timeout: float, where: Where, look: Any = lambda header, buffers: None
) -> tuple[list[float], list[Any], Any]:
    """Arrival times [s] and what `look` makes of each header, of what comes within `seconds` of the first sample.

    No array is decoded: on frames of a megabyte that would be most of the work.
    """
    from sonar_component.middleware.client import connect

    instance, deployment, key = where
    with connect(
        port, policy="circular_buffer", size=10_000, timeout=timeout, decoder=look,
        instance=instance, deployment=deployment, keys=key,
    ) as reader:  # fmt: skip
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
