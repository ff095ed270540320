"""`sonar run` and `sonar check`: a deployment, started or only looked at."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import typer

from sonar_component.cli.check import check_files


def register(app: typer.Typer) -> None:
    """Add the verbs."""
    app.command("run")(run)
    app.command("check")(check)
    app.command("schema")(schema)


def run(
    deployment: Path = typer.Argument(..., help="Deployment YAML."),
    seconds: float | None = typer.Option(None, min=0.0, help="Stop after this many seconds, with exit code 0."),
    settings: list[str] = typer.Option([], "--set", metavar="TASK.PROPERTY=VALUE", help="Overrides the file."),
    name: str | None = typer.Option(None, help="Name of this instance; the file's own otherwise."),
    host: str = typer.Option("", help="Run only the tasks of this host."),
) -> None:
    """Run a deployment until Ctrl-C."""
    from sonar_component.middleware.deployment import check_deployment
    from sonar_component.middleware.supervisor import Supervisor
    from sonar_component.settings.paths import find_file

    plan = check_deployment(find_file(deployment), overrides(settings), name)
    host = chosen_host(plan.hosts, host)
    if plan.insecure:
        what = "others can read ports and order tasks about without keys"
        _print_event(f"warning: {what}, as the file says (insecure: true)")
    raise typer.Exit(Supervisor(plan, _print_event, host).run(seconds))


def check(
    files: list[Path] = typer.Argument(..., help="Deployment YAML files; also sonars and scenes."),
    as_json: bool = typer.Option(False, "--json", help="Print what each of them comes to."),
) -> None:
    """Find every mistake of deployments, sonars and scenes without starting anything."""
    code = check_files(files, as_json)
    if code:
        raise typer.Exit(code)


def chosen_host(hosts: dict[str, Any], name: str) -> str:
    """The host to be run here: the first of the file unless another is named.

    Raises
    ------
    SettingsError
        If there is none of that name, or it needs keys that are not here.
    """
    from sonar_component.settings.errors import SettingsError, suggest

    if name and name not in hosts:
        raise SettingsError(f"--host: no host {name!r}{suggest(name, hosts)}; hosts: {', '.join(hosts) or 'none'}")
    name = name or next(iter(hosts), "")
    if any(host["key"] for host in hosts.values()):
        from sonar_component.middleware.transport.keys import own_keys

        own_keys(name)
    return name


def schema() -> None:
    """Print the JSON Schema of deployment files, for editors: properties of the installed task types are in it."""
    from sonar_component.middleware.deployment.schema import deployment_schema

    print(json.dumps(deployment_schema(), indent=2))


def overrides(settings: list[str]) -> dict[str, dict[str, Any]]:
    """``task.property=value`` texts as task -> property -> value; values are read as in YAML.

    Raises
    ------
    SettingsError
        If one has not that form.
    """
    from sonar_component.settings.errors import SettingsError

    found: dict[str, dict[str, Any]] = {}
    for text in settings:
        target, equals, value = text.partition("=")
        task, dot, key = target.partition(".")
        if not (equals and dot and task and key):
            raise SettingsError(f"--set: must be TASK.PROPERTY=VALUE, got {text!r}")
        found.setdefault(task, {})[key] = parse_value(value)
    return found


def parse_value(text: str) -> Any:
    """A value as it would stand in a deployment file."""
    from sonar_component.settings.loader import load_yaml

    return load_yaml("--set", text).data


def _print_event(line: str) -> None:
    print(f"{time.strftime('%H:%M:%S')} {line}", flush=True)


def print_json(value: Any) -> None:
    """One JSON document on one line."""
    from sonar_component.middleware.transport.control import plain

    print(json.dumps(value, default=plain))
