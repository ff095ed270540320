"""`sonar emulate`: an endpoint compatible with a real sonar, at a fixed pose in a scene, without a deployment."""

from __future__ import annotations

import json
import logging
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from sonar_component.cli.ping import _pose

if TYPE_CHECKING:
    from sonar_component.devices.station import Station

_LOOK = 0.2  # [s], between two looks whether the device is still at work

_SCENE = typer.Option(..., help="Scene YAML, SDF world, or a mesh file (metres, Z up).")
_SONAR = typer.Option(None, help="YAML with properties of the endpoint: beam, water, timing.")
_SET = typer.Option([], "--set", metavar="NAME=VALUE", help="One more property; overrides the YAML.")
_POSITION = typer.Option((0.0, 0.0, 0.0), help="Of the sonar in m: X Y Z, Z up.")
_RPY = typer.Option(None, help="In deg: roll, pitch (positive is nose down) and yaw (positive is left).")
_QUATERNION = typer.Option(None, help="Orientation instead: W X Y Z.")
_SECONDS = typer.Option(None, min=0.0, help="Stop after this many seconds, with exit code 0.")
_REMOTE = typer.Option(False, "--allow-remote", help="Let other computers reach the endpoint: they control the sonar.")
_JSON = typer.Option(False, "--json", help="Print JSON: a line when serving, one at the end.")


def register(app: typer.Typer) -> None:
    """Add the verbs."""
    group = typer.Typer(no_args_is_help=True, help="Stand in for a real sonar on its own wire.")
    for verb in (ping360, oculus, micron):
        group.command(verb.__name__)(verb)
    app.add_typer(group, name="emulate")


def ping360(
    scene: Path = _SCENE,
    udp: str | None = typer.Option(None, help="HOST:PORT to serve; 127.0.0.1:12345 if there is no --pty; port 0: any."),
    pty: Path | None = typer.Option(None, help="Name of a serial line to make, such as /tmp/ttyPing360."),
    discovery: str | None = typer.Option(None, help="HOST:PORT of discovery by UDP instead of 127.0.0.1:30303."),
    sonar: Path | None = _SONAR,
    settings: list[str] = _SET,
    position: tuple[float, float, float] = _POSITION,
    rpy_deg: tuple[float, float, float] | None = _RPY,
    quaternion: tuple[float, float, float, float] | None = _QUATERNION,
    seconds: float | None = _SECONDS,
    allow_remote: bool = _REMOTE,
    as_json: bool = _JSON,
) -> None:
    """Ping360-compatible endpoint: a scanning sonar over UDP or a serial line."""
    from sonar_component.devices.ping360 import Ping360Properties, open_ping360

    options = {"udp": udp, "pty": pty, "discovery": discovery, "allow_remote": allow_remote or None}
    if pty is not None and udp is None:
        options["udp"] = ""
    pose = _pose(position, rpy_deg, quaternion)
    properties = _properties(Ping360Properties, sonar, settings, options)
    _serve("Ping360", open_ping360, properties, scene, pose, seconds, as_json)


def oculus(
    scene: Path = _SCENE,
    tcp: str | None = typer.Option(None, help="HOST:PORT to serve instead of 127.0.0.1:52100; port 0: any."),
    status_to: str | None = typer.Option(None, help="HOST:PORT to tell the status to instead of 127.0.0.1:52102."),
    log: Path | None = typer.Option(None, help="File for a log of all pings, such as wreck.oculus."),
    sonar: Path | None = _SONAR,
    settings: list[str] = _SET,
    position: tuple[float, float, float] = _POSITION,
    rpy_deg: tuple[float, float, float] | None = _RPY,
    quaternion: tuple[float, float, float, float] | None = _QUATERNION,
    seconds: float | None = _SECONDS,
    allow_remote: bool = _REMOTE,
    as_json: bool = _JSON,
) -> None:
    """Oculus-compatible endpoint: a multibeam sonar over TCP."""
    from sonar_component.devices.oculus import OculusProperties, open_oculus

    options = {"tcp": tcp, "status_to": status_to, "log": log, "allow_remote": allow_remote or None}
    pose = _pose(position, rpy_deg, quaternion)
    properties = _properties(OculusProperties, sonar, settings, options)
    _serve("Oculus", open_oculus, properties, scene, pose, seconds, as_json)


def micron(
    scene: Path = _SCENE,
    pty: Path = typer.Option(..., help="Name of the serial line to make, such as /tmp/ttyMicron."),
    sonar: Path | None = _SONAR,
    settings: list[str] = _SET,
    position: tuple[float, float, float] = _POSITION,
    rpy_deg: tuple[float, float, float] | None = _RPY,
    quaternion: tuple[float, float, float, float] | None = _QUATERNION,
    seconds: float | None = _SECONDS,
    as_json: bool = _JSON,
) -> None:
    """Micron-compatible endpoint: a scanning sonar over a serial line."""
    from sonar_component.devices.micron import MicronProperties, open_micron

    pose = _pose(position, rpy_deg, quaternion)
    properties = _properties(MicronProperties, sonar, settings, {"pty": pty})
    _serve("Micron", open_micron, properties, scene, pose, seconds, as_json)


def _properties(model: Any, file: Path | None, settings: list[str], options: dict[str, Any]) -> Any:
    from sonar_component.settings.loader import Document, load_yaml, overlay
    from sonar_component.settings.paths import find_file
    from sonar_component.settings.validation import validate

    document = load_yaml(find_file(file)) if file is not None else Document({}, "endpoint")
    document = overlay(document, settings, "--set")
    for name, value in options.items():
        if value is not None:
            document.data[name] = value if isinstance(value, bool) else str(value)
            document.overrides[(name,)] = f"--{name.replace('_', '-')}"
    return validate(model, document)


def _serve(
    name: str, open_device: Callable[..., Station], properties: Any, scene: Path, pose: Any, seconds: float | None,
    as_json: bool,
) -> None:  # fmt: skip
    from sonar_component.gl import GLUnavailableError
    from sonar_component.scene import load_world
    from sonar_component.settings.errors import SettingsError
    from sonar_component.settings.paths import find_file

    stop = _stop_on_signals()
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s: %(message)s")
    try:
        world = load_world(find_file(scene))
    except ValueError as error:
        raise error if isinstance(error, SettingsError) else SettingsError(str(error), str(scene)) from None
    try:
        station = open_device(properties, logging.getLogger(name))
        station.echoes.look_at(world)
        station.echoes.pose = pose
        station.start()
    except (OSError, GLUnavailableError) as error:
        raise SettingsError(str(error)) from None
    _say(f"{name}-compatible endpoint at {station.describe()}", {"endpoint": name, "at": station.describe()}, as_json)
    for line in [*world.warnings, *(f"other computers can reach {place}" for place in properties.remote())]:
        typer.echo(f"warning: {line}", err=True)
    _wait(station, stop, seconds)
    station.stop()
    _report(station, as_json)
    if station.failure is not None:
        raise typer.Exit(1)


def _stop_on_signals() -> threading.Event:
    """Set by Ctrl-C and SIGTERM from now on: whoever sees that the endpoint serves may end it at once."""
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    return stop


def _wait(station: Station, stop: threading.Event, seconds: float | None) -> None:
    """Until told to stop, out of time, or the device has failed."""
    end = None if seconds is None else time.monotonic() + seconds
    while not stop.is_set() and station.failure is None:
        left = _LOOK if end is None else min(_LOOK, end - time.monotonic())
        if left <= 0:
            return
        stop.wait(left)


def _report(station: Station, as_json: bool) -> None:
    t = station.timing()
    share = f"{t.late} of {t.pings} more than 1 ms late, 99 % at most {1e3 * t.lateness_p99:.2f} ms"
    _say(f"{t.pings} pings: {share}" if t.pings else "no client asked for a ping", {"timing": vars(t)}, as_json)


def _say(text: str, data: dict[str, Any], as_json: bool) -> None:
    print(json.dumps(data) if as_json else text, flush=True)
