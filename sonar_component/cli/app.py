"""The command ``sonar``: collects the groups of verbs; each group imports what it needs only when it is called."""

from __future__ import annotations

import sys
from importlib import import_module

import typer

from sonar_component.settings.errors import SettingsError

_GROUPS = ("run", "ports", "ping", "pictures", "doctor")

app = typer.Typer(no_args_is_help=True, pretty_exceptions_enable=False, help="Real-time simulator of imaging sonar.")


def main() -> None:
    """Run the command line; a user's mistake prints one line each and exits with 2."""
    for group in _GROUPS:
        import_module(f"sonar_component.cli.{group}").register(app)
    try:
        app()
    except SettingsError as error:
        print(error, file=sys.stderr)
        sys.exit(2)
