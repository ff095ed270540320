"""`sonar bench`: speed and error, measured together."""

from __future__ import annotations

import json
import platform
import sys
from pathlib import Path
from typing import Any

import typer

_WIDTH = 140  # [characters], of tables that go to a file or a pipe
_NAMES = ("tables", "error", "scaling", "transport")


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("bench")(bench)


def bench(
    names: list[str] = typer.Argument(None, metavar="[tables|error|scaling|transport]...", help="All by default."),
    json_file: Path | None = typer.Option(None, "--json", metavar="FILE", help="Write the figures here."),
    plots: Path | None = typer.Option(None, metavar="DIR", help="Draw time against error and scaling here."),
    samples: int = typer.Option(500, min=10, help="Frames per row of the tables."),
    accuracy: list[float] = typer.Option([0.02], help="Targets of the tables' rows; may be given several times."),
) -> None:
    """Measure speed and error on the standard scenes."""
    from rich.console import Console
    from rich.progress import Progress

    from sonar_component.cli.benchmarks import report
    from sonar_component.settings.errors import SettingsError, suggest

    for name in names or []:
        if name not in _NAMES:
            raise SettingsError(f"bench: there is no benchmark {name!r}{suggest(name, _NAMES)}: {', '.join(_NAMES)}")
    console = Console(width=None if sys.stdout.isatty() else _WIDTH)
    results: dict[str, Any] = {"machine": _machine()}
    with Progress(console=console, transient=True) as progress:
        for name in names or _NAMES:
            task = progress.add_task(name, total=None)
            results[name] = _run(name, samples, tuple(accuracy), progress.console.log, lambda: progress.advance(task))  # noqa: B023 (called at once)
            progress.remove_task(task)
    report.show(console, results)
    if json_file is not None:
        json_file.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    if plots is not None:
        plots.mkdir(parents=True, exist_ok=True)
        for file in report.plot(results, plots):
            console.print(f"drawn: {file}")


def _run(name: str, samples: int, accuracies: tuple[float, ...], say: Any, tick: Any) -> Any:
    if name == "tables":
        from sonar_component.cli.benchmarks import tables

        return tables.run(samples, accuracies, say, tick)
    if name == "error":
        from sonar_component.cli.benchmarks import error

        return error.run(min(samples, 200), say, tick)
    if name == "scaling":
        from sonar_component.cli.benchmarks import scaling

        return scaling.run(min(samples, 100), say, tick)
    from sonar_component.middleware.benchmark import bench_transport

    return bench_transport()


def _machine() -> dict[str, Any]:
    import os

    from sonar_component.gl import create_context

    info = create_context().info
    return {
        "processor": _processor(), "cores": len(os.sched_getaffinity(0)), "renderer": info["GL_RENDERER"],
        "opengl": info["GL_VERSION"], "python": platform.python_version(),
    }  # fmt: skip


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), platform.machine())
