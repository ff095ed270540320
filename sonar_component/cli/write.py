"""`sonar write`: samples into an input port of a running task, from a file or from the command line."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from sonar_component.cli import complete
from sonar_component.cli.ports import INSTANCE, JSON, TIMEOUT
from sonar_component.cli.run import print_json

if TYPE_CHECKING:
    from sonar_component.middleware.writer import PortWriter
    from sonar_component.settings.loader import Document

_SETTLE = 1.0  # [s], above the half second after which the task's account is asked for again


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("write")(write)


def write(
    port: str = typer.Argument(
        ..., metavar="TASK.PORT", help="Input port of a running task.", autocompletion=complete.inputs
    ),
    sample: str = typer.Argument(
        ..., metavar="FILE|YAML", help="File with the sample's fields, - for standard input, or YAML itself."
    ),
    rate: float | None = typer.Option(None, min=0.001, help="Write again and again, so many times a second."),
    count: int | None = typer.Option(None, "--count", "-n", min=1, help="Stop after so many; 1 without a rate."),
    shared: bool = typer.Option(False, help="Also where somebody writes to the port already: samples take turns."),
    as_json: bool = JSON,
    timeout: float = TIMEOUT,
    instance: str | None = INSTANCE,
) -> None:
    """Write to an input port: a pose, a command. Fields that are not given stay unset; time is now."""
    from sonar_component.middleware.client import connect
    from sonar_component.middleware.compose import compose
    from sonar_component.middleware.ports import InvalidSampleError
    from sonar_component.settings.errors import SettingsError

    document = _document(sample)
    with connect(port, write=True, policy="buffer", timeout=timeout, instance=instance, shared=shared) as writer:
        due, left = time.monotonic(), count if rate else count or 1
        while left is None or left > 0:
            try:
                writer.write(compose(writer.sample_type, document))
            except InvalidSampleError as error:
                raise SettingsError(error.reason, document.file) from None
            left = None if left is None else left - 1
            if rate and left != 0:
                due += 1 / rate
                time.sleep(max(0.0, due - time.monotonic()))
        received = _received(writer)
    if as_json:
        print_json({"port": writer.name, "type": writer.sample_type.__name__, "written": writer.written, **received})
    else:
        arrived = f"{received['received']} received, {received['dropped']} dropped"
        print(f"{writer.name}: {writer.written} written, {arrived}")


def _received(writer: PortWriter[Any]) -> dict[str, int]:
    """The task's account, once it has all."""
    end = time.monotonic() + _SETTLE
    while (account := writer.account).received < writer.written and time.monotonic() < end:
        time.sleep(0.02)
    return {"received": account.received, "dropped": account.dropped, "lost": account.lost}


def _document(sample: str) -> Document:
    from sonar_component.settings.loader import load_yaml

    if sample == "-":
        return load_yaml("standard input", sys.stdin.read())
    if sample.lstrip().startswith("{"):
        return load_yaml("the command line", sample)
    return load_yaml(Path(sample))
