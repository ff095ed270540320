"""Task types by name: only what an installed package declares in the entry-point group ``sonar_component.tasks``.

A deployment cannot name a module path: a file that came by mail must not decide which code is imported.
"""

from __future__ import annotations

from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points

from sonar_component.middleware.task import Task
from sonar_component.settings.errors import suggest

GROUP = "sonar_component.tasks"


@lru_cache(maxsize=1)
def _declared() -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=GROUP)}


def task_type_names() -> list[str]:
    """Every declared type."""
    return sorted(_declared())


def task_type(name: str) -> type[Task]:
    """Import a task type.

    Raises
    ------
    ValueError
        If no package declares it, or it cannot be imported; says why.
    """
    point = _declared().get(name)
    if point is None:
        known = task_type_names()
        raise ValueError(f"is not a known task type{suggest(name, known)}; installed: {', '.join(known)}")
    try:
        loaded = point.load()
    except Exception as error:  # whatever a foreign module raises, the deployment gets one line
        raise ValueError(f"cannot be imported from {point.value}: {type(error).__name__}: {error}") from None
    if not (isinstance(loaded, type) and issubclass(loaded, Task)):
        raise ValueError(f"{point.value} is not a Task")
    return loaded
