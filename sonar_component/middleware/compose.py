"""A sample from plain values, such as those of a YAML file: the reverse of what `sonar echo` prints of a small one."""

from __future__ import annotations

import dataclasses
import time
from typing import Any

import numpy as np

from sonar_component.middleware.schema import Field, schema_of
from sonar_component.settings.errors import SettingsError, SettingsErrors, suggest
from sonar_component.settings.loader import Document

_SCALARS: dict[str, tuple[type, ...]] = {"int": (int,), "float": (int, float), "str": (str,), "bool": (bool,)}


def compose(cls: type, document: Document) -> Any:
    """Build a sample of a dataclass; what is not given keeps its default, and ``time`` is now.

    Raises
    ------
    SettingsErrors
        Every mistake, with its line and what is allowed.
    """
    fields = {field.name: field for field in schema_of(cls).fields}
    given = document.data
    if not isinstance(given, dict):
        raise document.error((), f"must be a mapping of fields of {cls.__name__} to values, got {given!r}")
    values: dict[str, Any] = {}
    errors: list[SettingsError] = []
    for name, value in given.items():
        wrong, values[name] = _value(cls, fields, str(name), value)
        errors += [document.error((name,), wrong)] if wrong else []
    missing = [f.name for f in dataclasses.fields(cls) if _is_required(f) and f.name not in given]
    errors += [document.error((), f"{name} is required") for name in missing]
    if errors:
        raise SettingsErrors(errors)
    sample = cls(**values)
    if "time" in fields and not given.get("time"):
        sample.time = time.time_ns() // 1000
    return sample


def _value(cls: type, fields: dict[str, Field], name: str, value: Any) -> tuple[str, Any]:
    """What is wrong with a field, or the empty string, and its value."""
    if name not in fields:
        return f"is not a field of {cls.__name__}{suggest(name, fields)}; it has: {', '.join(fields)}", None
    field = fields[name]
    if field.kind == "array":
        array = _array(field, value)
        return ("" if array is not None else f"must be a list of numbers, got {value!r}"), array
    if type(value) not in _SCALARS[field.kind]:  # not isinstance: true is no int in YAML
        return f"must be {field.kind}, got {value!r}", None
    return "", float(value) if field.kind == "float" else value


def _array(field: Field, value: Any) -> Any:
    try:
        array = np.array(value, dtype=field.dtype or None)
    except (ValueError, TypeError, OverflowError):
        return None
    return array if array.dtype.kind in "biuf" and isinstance(value, list) else None


def _is_required(field: dataclasses.Field[Any]) -> bool:
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
