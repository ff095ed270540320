"""One line for each setting: what it means, its unit and its limits, taken from the model, where they hold."""

from __future__ import annotations

from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel

from sonar_component.settings.quantity import UNITS, Dimension, describe

_LOW, _HIGH = {"ge": "at least", "gt": "above"}, {"le": "at most", "lt": "below"}


def meaning(model: type[BaseModel], name: str) -> str:
    """``end of the last bin [m]; 0.1 m to 1000 m``; of a field that a class declares anew, in its base's words."""
    bases = (getattr(base, "model_fields", {}).get(name) for base in model.__mro__)
    words = next((field.description for field in bases if field is not None and field.description), "")
    field = model.model_fields[name]
    dimension = next((part.name for part in field.metadata if isinstance(part, Dimension)), "")
    unit = next(iter(UNITS[dimension])) if dimension else ""
    if unit and "[" not in words:
        subject, separator, rest = words.partition("; ")
        words = f"{subject} [{unit}]{separator}{rest}"
    allowed = _limits(getattr(model, "limits", {}).get(name), field.metadata, dimension) or _choices(field.annotation)
    return "; ".join(part for part in (words, allowed) if part)


def _limits(own: tuple[str, float, float] | None, metadata: list[Any], dimension: str) -> str:
    """``0 to 1`` and the like; from what the model declares beside its fields, or at the field."""
    if own is not None:
        return f"{describe(own[1], own[0])} to {describe(own[2], own[0])}"
    bounds = {
        key: bound for part in metadata for key in (*_LOW, *_HIGH) if (bound := getattr(part, key, None)) is not None
    }
    shown = {key: describe(bound, dimension) if dimension else f"{bound:g}" for key, bound in bounds.items()}
    if {"ge", "le"} <= set(shown):
        return f"{shown['ge']} to {shown['le']}"
    return ", ".join(f"{word} {shown[key]}" for key, word in (_LOW | _HIGH).items() if key in shown)


def _choices(annotation: Any) -> str:
    """``mean or energy`` where one of a few words must be given."""
    if get_origin(annotation) is not Literal:
        annotation = next((part for part in get_args(annotation) if get_origin(part) is Literal), None)
    words = get_args(annotation)
    return " or ".join(map(str, words)) if len(words) > 1 else ""
