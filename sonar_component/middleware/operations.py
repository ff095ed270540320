"""Operations: methods that others may call, run in the task's own thread.

As in Rock they are for the seldom case; what flows belongs on ports, what is set belongs in properties.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any, TypeVar

from pydantic import ValidationError, validate_call

F = TypeVar("F", bound=Callable[..., Any])
_MARK = "__operation__"


def operation(method: F) -> F:
    """Mark a method of a task as an operation; its arguments are checked against their annotations."""
    setattr(method, _MARK, True)
    return method


def operations_of(task_class: type) -> dict[str, str]:
    """Name -> signature of every operation."""
    found = inspect.getmembers(task_class, lambda member: getattr(member, _MARK, False))
    return {name: _without_self(str(inspect.signature(method))) for name, method in found}


def _without_self(signature: str) -> str:
    return signature.replace("(self, ", "(", 1).replace("(self)", "()", 1)


def call(task: Any, name: str, arguments: dict[str, Any]) -> Any:
    """Call an operation by name.

    Raises
    ------
    ValueError
        If there is no such operation or an argument does not fit; says what is allowed.
    """
    known = operations_of(type(task))
    if name not in known:
        raise ValueError(f"{task.name} has no operation {name!r}; it has: {', '.join(known) or 'none'}")
    try:
        with task.within(f"operation {name}"):
            return validate_call(getattr(task, name))(**arguments)
    except ValidationError as error:
        problems = "; ".join(f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors())
        raise ValueError(f"{task.name}.{name}{known[name]}: {problems}") from None
