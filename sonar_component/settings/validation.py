"""From a loaded document to a validated model: pydantic's findings become mistakes at a line, in the user's words.

Pydantic says "input should be"; people ask which unit, which key and what to write instead. A union of types gives one
finding for each alternative; they are joined, since the user made one mistake.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Sequence
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from sonar_component.settings.errors import SettingsError, SettingsErrors, nearest, suggest
from sonar_component.settings.loader import Document, KeyPath
from sonar_component.settings.quantity import UNITS, Dimension, describe

Model = TypeVar("Model", bound=BaseModel)

_BOUNDS = {  # pydantic's type of error -> the key of its bound, and our word for it
    "greater_than": ("gt", "above"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "below"),
    "less_than_equal": ("le", "at most"),
}
_KINDS = {  # pydantic's type of error -> what a file must hold there
    "model_type": "a mapping of keys to values",
    "dict_type": "a mapping of keys to values",
    "list_type": "a list",
}
_LITERAL = re.compile(r"'([^']*)'")


def validate(model: type[Model], document: Document, at: KeyPath = ()) -> Model:
    """Build a model from the part of a document at a key path.

    Raises
    ------
    SettingsErrors
        All mistakes at once, each with file, line and key, and the nearest valid name or unit.
    """
    data = document.at(at)
    if not isinstance(data, dict):
        raise SettingsErrors([document.error(at, f"must be a mapping of keys to values, got {data!r}")])
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise SettingsErrors(_explain(model, data, error.errors(), document, at)) from None


def _explain(
    model: type[BaseModel], data: Any, items: Sequence[Any], document: Document, at: KeyPath
) -> list[SettingsError]:
    """One mistake for each place, in the order of the file."""
    found = sorted(explain(model, data, items), key=lambda mistake: document.position((*at, *mistake[0])))
    return [document.error((*at, *place), words) for place, words in found]


def explain(model: type[BaseModel], data: Any, items: Sequence[Any]) -> list[tuple[KeyPath, str]]:
    """What pydantic found, in the user's words: (place in the data, what is wrong there), one for each place."""
    places: dict[KeyPath, list[Any]] = {}
    for item in (_plainer(item) for item in items):
        places.setdefault(_place(data, item["loc"]), []).append(item)
    # [1 deg, 2 m] is not one of the allowed words either; what is wrong is its second item.
    blunt = [place for place in places if any(len(p) > len(place) > 0 and p[: len(place)] == place for p in places)]
    blunt += _meant(model, places)
    mistakes = []
    for place in (place for place in places if place not in blunt):
        words = ", or ".join(dict.fromkeys(_words(model, place, item) for item in places[place]))
        got = f", got {places[place][0]['input']!r}" if _wants_value(places[place], words) else ""
        hint = _word_hint(places[place]) or _unit_hint(model, data, place, places[place])
        mistakes.append(_at_its_key(data, place, words + got + hint))
    return mistakes


def _plainer(item: Any) -> Any:
    """A finding about the word that picks one of several models is one about a literal at that word's key."""
    if item["type"] not in ("union_tag_invalid", "union_tag_not_found"):
        return item
    key = item["ctx"]["discriminator"].strip("'")
    if item["type"] == "union_tag_not_found":
        return {**item, "type": "missing", "loc": (*item["loc"], key)}
    expected = item["ctx"]["expected_tags"]
    changed = {"type": "literal_error", "msg": f"Input should be one of {expected}", "ctx": {"expected": expected}}
    return {**item, **changed, "loc": (*item["loc"], key), "input": item["ctx"]["tag"]}


def _at_its_key(data: Any, place: KeyPath, words: str) -> tuple[KeyPath, str]:
    """What a check of a whole model says of one key belongs to that key, wherever it was set."""
    key, _, rest = words.partition(" ")
    inside = _at(data, place)
    if isinstance(inside, dict) and key in inside and rest.startswith("must "):
        return (*place, key), rest
    return place, words


def _meant(model: type[BaseModel], places: dict[KeyPath, list[Any]]) -> list[KeyPath]:
    """Keys that are missing because an unknown one beside them is a slip of theirs."""
    unknown = [place for place, items in places.items() if items[0]["type"] == "extra_forbidden"]
    meant = [(*place[:-1], nearest(str(place[-1]), fields_at(model, place[:-1]))) for place in unknown]
    return [place for place in meant if place in places and places[place][0]["type"] == "missing"]


def _place(data: Any, location: Sequence[str | int]) -> KeyPath:
    """Where in the data an error is: pydantic's location without the names of a union's alternatives."""
    path: KeyPath = ()
    for index, part in enumerate(location):
        if _holds(data, part):
            path, data = (*path, part), data[part]
        elif isinstance(data, dict) and index == len(location) - 1:
            path = (*path, part)  # a key that is missing
    return path


def _words(model: type[BaseModel], place: KeyPath, item: Any) -> str:
    if item["type"] == "missing":
        short = isinstance(item["loc"][-1], int) and isinstance(item["input"], (list, tuple))
        return f"must hold more than {len(item['input'])} values, got {item['input']!r}" if short else "is required"
    if item["type"] == "too_long":
        return f"must hold at most {item['ctx']['max_length']} values"
    if item["type"] == "extra_forbidden":
        names = fields_at(model, place[:-1])
        hint = suggest(str(place[-1]), names) or (f"; allowed: {', '.join(names)}" if names else "")
        return f"is not a known key{hint}"
    if item["type"] in _BOUNDS:
        key, word = _BOUNDS[item["type"]]
        return f"must be {word} {_with_unit(model, place, item['ctx'][key])}"
    if item["type"] in ("int_from_float", "int_parsing"):
        return "must be a whole number"
    if item["type"] in _KINDS:
        return f"must be {_KINDS[item['type']]}"
    message = str(item["msg"]).removeprefix("Value error, ").replace("Input should be", "must be")
    return message[0].lower() + message[1:]


def _word_hint(items: list[Any]) -> str:
    """The nearest of the few words that may stand there."""
    words = [item for item in items if item["type"] == "literal_error" and isinstance(item["input"], str)]
    return next((suggest(item["input"], _LITERAL.findall(item["ctx"]["expected"])) for item in words), "")


def _wants_value(items: list[Any], words: str) -> bool:
    silent = {"missing", "extra_forbidden"}
    return not any(item["type"] in silent for item in items) and ", got " not in words


def _with_unit(model: type[BaseModel], place: KeyPath, bound: float) -> str:
    field = _field_at(model, place)
    dimension = next((m.name for m in getattr(field, "metadata", ()) if isinstance(m, Dimension)), None)
    return describe(bound, dimension) if dimension else f"{bound:g}"


def _unit_hint(model: type[BaseModel], data: Any, place: KeyPath, items: list[Any]) -> str:
    """A unit with which a refused bare number would be good: ``beam_width: 120`` must have meant degrees."""
    value = _at(data, place)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not place:
        return ""
    if any(item["type"] in (*_KINDS, "string_type") for item in items):
        return ""  # it would be good as any text is
    trial = copy.deepcopy(data)
    for unit in dict.fromkeys(unit for units in UNITS.values() for unit in units if unit):
        _at(trial, place[:-1])[place[-1]] = text = f"{value} {unit}"
        try:
            model.model_validate(trial)
        except ValidationError as error:
            if any(_place(trial, item["loc"]) in (place, ()) for item in error.errors()):
                continue
        return f' (did you mean "{text}"?)'
    return ""


def _at(data: Any, path: KeyPath) -> Any:
    for part in path:
        data = data[part] if _holds(data, part) else None
    return data


def _holds(data: Any, part: str | int) -> bool:
    return part in data if isinstance(data, dict) else isinstance(data, list) and part in range(len(data))


def _field_at(model: type[BaseModel], place: KeyPath) -> Any:
    """The declaration of the field at a place, None if it is inside a list or a union."""
    current, field = model, None
    for part in place:
        field = getattr(current, "model_fields", {}).get(part)
        current = next(iter(_models_in(getattr(field, "annotation", None))), None)  # type: ignore[assignment]
    return field


def fields_at(model: type[BaseModel], place: KeyPath) -> list[str]:
    """Field names of the (nested) model at a place."""
    current: Any = model
    for part in place:
        fields = getattr(current, "model_fields", {})
        if part in fields:
            current = next(iter(_models_in(fields[part].annotation)), None)
    return list(getattr(current, "model_fields", {}))


def _models_in(annotation: Any) -> list[Any]:
    if hasattr(annotation, "model_fields"):
        return [annotation]
    return [model for inner in getattr(annotation, "__args__", ()) for model in _models_in(inner)]
