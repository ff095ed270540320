"""`sonar snapshot` and `sonar view`: looking at what a running graph sends."""

from __future__ import annotations

import json
import shutil
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import typer

from sonar_component.settings.errors import SettingsError

if TYPE_CHECKING:
    from sonar_component.samples import Frame, Sonar

_TURN_PATIENCE = 30.0  # [s], for a scanning head to go round: slow ones take about that long at 50 m


def register(app: typer.Typer) -> None:
    """Add the verbs."""
    app.command("snapshot")(snapshot)
    app.command("view")(view)


def snapshot(
    port: str = typer.Argument(..., metavar="TASK.PORT", help="Output port that sends images."),
    out: Path = typer.Option(..., help="FILE.png"),
    kind: Literal["fan", "polar"] = typer.Option("fan", "--view", help="From above, or bearing against range."),
    colour_map: Literal["copper", "gray", "viridis"] = typer.Option("copper", "--map", help="Colour map."),
    scale: Literal["db", "linear"] = typer.Option("db", help="Law of the colours."),
    dynamic_range: float = typer.Option(40.0, min=1.0, max=120.0, help="Of the colours [dB]."),
    gain: float = typer.Option(0.0, min=-60.0, max=60.0, help="Brightens the picture [dB]; the data stay as they are."),
    seconds: float | None = typer.Option(None, min=0.0, help="Of a scanning sonar: gather beams so long, not a turn."),
    timeout: float = typer.Option(5.0, min=0.0, help="Seconds to wait for the first image."),
    instance: str | None = typer.Option(None, help="Which instance, where several run."),
    deployment: Path | None = typer.Option(None, metavar="FILE", help="Reach tasks of this deployment's other hosts."),
    key: str | None = typer.Option(None, metavar="NAME", help="Which of our pairs of keys to show to another host."),
    as_json: bool = typer.Option(False, "--json", help="Say in JSON what was written."),
) -> None:
    """Write the next image of a port as a PNG file; of a scanning sonar, its next turn."""
    if out.suffix.lower() != ".png":
        raise SettingsError(f"--out must end in .png, got {str(out)!r}")
    if not out.absolute().parent.is_dir():
        raise SettingsError(f"--out: there is no folder {out.parent}")
    image = _receive(port, timeout, {"instance": instance, "deployment": deployment, "keys": key}, seconds)
    try:
        facts = _write(image, out, port, kind, colour_map, scale, dynamic_range, gain)
    except OSError as error:
        raise SettingsError(f"--out: {out} cannot be written: {error.strerror}") from None
    print(json.dumps(facts) if as_json else f"{facts['file']}: {facts['shows']}")


def _receive(port: str, timeout: float, where: dict[str, Any], seconds: float | None) -> Sonar | Frame:
    """The next image; single beams are gathered into a turn."""
    from sonar_component.middleware.client import connect
    from sonar_component.samples import Frame, Sonar

    with connect(port, timeout=timeout, policy="circular_buffer", size=256, **where) as reader:
        if reader.type_name not in (Sonar.__name__, Frame.__name__):
            raise SettingsError(f"{port} sends {reader.type_name}; a picture needs Sonar or Frame")
        try:
            first = reader.read()
        except TimeoutError as error:
            print(f"{error}; is its task running? see: sonar list", file=sys.stderr)
            raise typer.Exit(1) from None
        if isinstance(first, Sonar) and first.beam_count == 1:
            return _turn(reader, first, _TURN_PATIENCE if seconds is None else seconds, whole=seconds is None)
        image: Sonar | Frame = first
        return image


def _turn(reader: Any, first: Sonar, patience: float, whole: bool) -> Sonar:
    """Beams from now on, until each direction was seen again or the time is over."""
    from sonar_component.pictures.sweep import SLOTS, Sweep

    sweep, end = Sweep(), time.monotonic() + patience
    seen = set(sweep.add(first).tolist())
    new, known = 1, 0  # beams that showed something new, and beams since the last of them
    while (left := end - time.monotonic()) > 0:
        try:
            slots = set(sweep.add(reader.read(left)).tolist())
        except TimeoutError:
            break
        new, known = (new, known + 1) if slots <= seen else (new + 1, 0)
        seen |= slots
        # A head that turns back at a limit passes over what it has shown before it comes to the rest of its sector.
        if whole and (len(seen) == SLOTS or known > new):
            break
    return sweep.as_sonar()


def _write(
    image: Sonar | Frame, out: Path, port: str, kind: Any, colour_map: str, scale: Any, range_db: float, gain: float
) -> dict[str, Any]:
    from sonar_component.pictures.colours import fit_tone
    from sonar_component.pictures.figure import save_png, settings_line
    from sonar_component.samples import Sonar

    try:
        if isinstance(image, Sonar):
            tone = fit_tone(image.bins, scale, range_db, gain)
            save_png(image, out, kind, colour_map, tone, name=port)
            return {"file": str(out), "port": port, "time": image.time, "shows": settings_line(image)}
        return _write_frame(image, out, port)
    except ValueError as error:
        print(f"{port}: {error}", file=sys.stderr)
        raise typer.Exit(1) from None


def _write_frame(frame: Frame, out: Path, port: str) -> dict[str, Any]:
    import numpy as np
    from PIL import Image

    frame.validate()
    rows, columns, channels = frame.image.shape
    if frame.image.dtype != np.uint8 or channels not in (1, 3, 4):
        raise ValueError(f"a picture needs uint8 in 1, 3 or 4 channels, got {frame.image.dtype} in {channels}")
    pixels = frame.image[:, :, 0] if channels == 1 else frame.image
    Image.fromarray(np.ascontiguousarray(pixels)).save(out)
    return {"file": str(out), "port": port, "time": frame.time, "shows": f"{columns} x {rows} pixels"}


def print_picture(sample: Any) -> None:
    """Draw a sonar image in the terminal: in colour on a screen, in plain characters in a pipe or a file."""
    from sonar_component.pictures.text import text_picture
    from sonar_component.samples import Sonar

    if not isinstance(sample, Sonar):
        raise SettingsError(f"--plot draws images of type Sonar, not {type(sample).__name__}")
    columns = min(shutil.get_terminal_size().columns, 120)
    print(text_picture(sample, columns, colour=sys.stdout.isatty()), flush=True)


def view(
    instance: str | None = typer.Option(None, help="Which instance, where several run."),
    open_browser: bool = typer.Option(True, "--browser/--no-browser", help="Open it; else only say where it is."),
    as_json: bool = typer.Option(False, "--json", help="Print the address as JSON."),
) -> None:
    """Open the page of the running viewer."""
    from sonar_component.middleware.client import connect_task
    from sonar_component.middleware.reach import Reach
    from sonar_component.middleware.survey import survey

    tasks = survey(Reach(instance))
    if instance is not None and not tasks:
        raise SettingsError(f"no instance {instance!r} is running; see: sonar list")
    viewers = [task for task in tasks if task["type"] == "ViewerTask"]
    if not viewers:
        runs = "no viewer runs" if tasks else "nothing runs"
        print(f"{runs}; a deployment needs a task of type ViewerTask, see deploy/demo.yaml", file=sys.stderr)
        raise typer.Exit(1)
    task = viewers[0]
    if task["state"] != "RUNNING":
        print(f"{task['task']} is {task['state']}: {task['reason']}", file=sys.stderr)
        raise typer.Exit(1)
    with connect_task(task["task"], instance=task["instance"]) as viewer:
        page = viewer.call("page")
    print(json.dumps({"task": task["task"], "page": page}) if as_json else page)
    if open_browser and not as_json:
        import webbrowser

        webbrowser.open(page)
