"""The command ``sonar``: collects the groups of verbs; each group imports what it needs only when it is called."""

from __future__ import annotations

import gc
import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

from sonar_component.cli.check import check_quickly

if TYPE_CHECKING:
    import typer

_GROUPS = ("run", "ports", "write", "tasks", "keys", "ping", "pictures", "emulate", "doctor", "bench")
_INTERRUPTED = 130  # as shells have it: 128 + SIGINT
_NEW_OBJECTS = 100_000  # between two searches for garbage: above what imports make, which is no garbage


def build() -> typer.Typer:
    """The command with all its verbs."""
    import typer

    app = typer.Typer(
        no_args_is_help=True, pretty_exceptions_enable=False, help="Real-time simulator of imaging sonar."
    )
    for group in _GROUPS:
        import_module(f"sonar_component.cli.{group}").register(app)
    return app


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; a user's mistake prints one line each and exits with 2.

    Parameters
    ----------
    arguments : list of str, optional
        Those of the process by default.
    """
    given = sys.argv[1:] if arguments is None else arguments
    if arguments is None:
        gc.set_threshold(_NEW_OBJECTS)  # a tenth of a check's time
    try:
        quick = check_quickly(given)
        code = _parse(given) if quick is None else quick
    except KeyboardInterrupt:
        code = _INTERRUPTED
    except OSError as error:  # a full disk, a folder that may not be written: the machine's word, not a traceback
        where = f"{error.filename}: " if error.filename else ""
        print(f"{where}{error.strerror or error}", file=sys.stderr)
        code = 1
    if arguments is None:
        gc.freeze()  # else Python, as it ends, searches all modules for garbage twice: a sixth of a check's time
    sys.exit(code)


def _parse(given: list[str]) -> int:
    """Hand the arguments to the verb that they name; the exit code."""
    import typer

    from sonar_component.settings.errors import SettingsError

    # typer carries click inside from some version on; what both raise for a wrong command line is the base of this.
    wrong: Any = typer.BadParameter.__mro__[2]
    try:
        code = build()(args=given or ["--help"], prog_name="sonar", standalone_mode=False)
    except SettingsError as error:
        print(error, file=sys.stderr)
        return 2
    except wrong as error:
        print(_one_line(error), file=sys.stderr)
        return 2
    except typer.Abort:
        return _INTERRUPTED
    return code if isinstance(code, int) else 0


def _one_line(error: Any) -> str:
    context = getattr(error, "ctx", None)
    command = context.command_path if context else "sonar"
    message = " ".join(error.format_message().replace("Value error, ", "").split())
    return f"{command}: {message}{'' if message.endswith(('.', '?')) else '.'} See: {command} --help"
