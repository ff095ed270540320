"""What `sonar check` does, apart from how it is called.

Editors run it at every save, so it must be there in a moment: `check_quickly` does without the command line's library
(typer), which takes a fifth of the time, where the arguments are files alone and nothing is left to be parsed.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path


def check_quickly(arguments: Sequence[str]) -> int | None:
    """Exit code of ``sonar check FILE...``; None where that is not what was asked."""
    verb, *files = arguments or [""]
    if verb != "check" or not files or any(file.startswith("-") for file in files):
        return None
    # To find plugins, pydantic reads the metadata of every installed package; a check has no use for any.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    # OpenBLAS, which numpy loads, starts a thread for each core; they spin for 0.1 s and find nothing to do.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    return check_files(files)


def check_files(files: Iterable[str | Path], as_json: bool = False) -> int:
    """Print what each deployment, sonar or scene comes to, and every mistake to stderr; the exit code."""
    from sonar_component.middleware.deployment import check_deployment
    from sonar_component.settings.errors import SettingsError
    from sonar_component.settings.paths import find_file

    wrong = False
    for file in files:
        try:
            path = find_file(file)
            try:
                plan = check_deployment(path)
            except SettingsError:
                if not _is_named(file, path, as_json):
                    raise
                continue
        except SettingsError as error:
            print(error, file=sys.stderr)
            wrong = True
            continue
        if as_json:
            print(plan.to_json())
        else:
            processes = {task.process for task in plan.tasks}
            tasks, lines = len(plan.tasks), len(plan.connections)
            print(f"{file}: good: {tasks} tasks in {len(processes)} processes, {lines} connections")
    return 2 if wrong else 0


def _is_named(file: str | Path, path: Path, as_json: bool) -> bool:
    """Whether a file that is no deployment is a good sonar or scene, which deployments name; says what it comes to."""
    from sonar_component.cli.check_settings import check_named

    found = check_named(path)
    if found is None:
        return False
    words, data, warnings = found
    print(json.dumps({"file": str(file), **data, "warnings": warnings}) if as_json else f"{file}: good: {words}")
    for line in warnings:
        print(f"{file}: warning: {line}", file=sys.stderr)
    return True
