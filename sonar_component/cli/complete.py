"""What the shell offers for a half-typed word: names of what runs now."""

from __future__ import annotations

from typing import Any

COMMANDS = ("configure", "start", "stop", "cleanup", "recover")
_PATIENCE = 0.5  # [s], for a task to tell its properties


def tasks(incomplete: str) -> list[str]:
    """Running tasks."""
    return [name for name in _records() if name.startswith(incomplete)]


def outputs(incomplete: str) -> list[str]:
    """Output ports of running tasks."""
    return _ports(incomplete, "out")


def inputs(incomplete: str) -> list[str]:
    """Input ports of running tasks."""
    return _ports(incomplete, "in")


def properties(incomplete: str) -> list[str]:
    """Running tasks, then the properties of the one that is named."""
    return _members(incomplete, "properties")


def operations(incomplete: str) -> list[str]:
    """Running tasks, then the operations of the one that is named."""
    return _members(incomplete, "operations")


def commands(incomplete: str) -> list[str]:
    """What a task may be ordered to do."""
    return [name for name in COMMANDS if name.startswith(incomplete)]


def _ports(incomplete: str, direction: str) -> list[str]:
    ports = [(task, port) for task, record in _records().items() for port in record["ports"].items()]
    names = [f"{task}.{name}" for task, (name, port) in ports if port["direction"] == direction]
    return [name for name in names if name.startswith(incomplete)]


def _members(incomplete: str, kind: str) -> list[str]:
    task, records = incomplete.partition(".")[0], _records()
    fitting = [name for name in records if name.startswith(task)]
    if len(fitting) != 1:  # of a single one the members at once: the shell would put a space behind its name
        return fitting
    task = fitting[0]
    from sonar_component.middleware.proxy import TaskProxy

    proxy = TaskProxy(records[task], _PATIENCE)
    try:
        names = [f"{task}.{name}" for name in proxy.describe()[kind]]
    except (TimeoutError, RuntimeError):
        return []
    finally:
        proxy.close()
    return [name for name in names if name.startswith(incomplete)]


def _records() -> dict[str, dict[str, Any]]:
    from sonar_component.middleware.rundir import instances
    from sonar_component.settings.errors import SettingsError

    try:
        return {name: record for instance in instances() for name, record in instance.records().items()}
    except (SettingsError, OSError):
        return {}  # a word that cannot be completed is no reason to fill the prompt with errors
