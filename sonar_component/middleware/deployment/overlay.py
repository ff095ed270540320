"""A task's properties: config files laid over each other from left to right, then ``properties``.

    config: [sonar.yaml, default, long_range]

A file holds properties at its top level, or named ``sections``; words that are no file names choose sections of the
file before them, ``default`` where none is chosen.
"""

from __future__ import annotations

from typing import Any

from pydantic import ValidationError

from sonar_component.middleware.task import Task
from sonar_component.settings.errors import SettingsError, SettingsErrors, suggest
from sonar_component.settings.loader import Document, KeyPath, load_yaml
from sonar_component.settings.paths import find_file
from sonar_component.settings.validation import explain

Origin = tuple[Document, KeyPath]


def task_properties(
    document: Document, task: str, config: list[str], task_class: type[Task], certain: bool = True
) -> dict[str, Any]:
    """The merged and checked properties of one task, as they were written.

    Parameters
    ----------
    certain : whether these are all the files; if not, or if one of them cannot be read, nothing that is missing counts.

    Raises
    ------
    SettingsErrors
        Every mistake, at the place where the value stands that counts.
    """
    layers, mistakes = _layers(document, task, config)
    certain = certain and not mistakes
    values: dict[str, Any] = {}
    origins: dict[str, Origin] = {}
    for layer, at in layers:
        for key, value in (layer.at(at) or {}).items():
            values[key], origins[key] = value, (layer, (*at, key))
    here: Origin = (document, ("tasks", task, "properties"))
    try:
        model = task_class.Properties.model_validate(values)
    except ValidationError as error:
        found = explain(task_class.Properties, values, error.errors())
        mistakes += [_place(place, words, origins, here) for place, words in found if certain or _given(place, values)]
    else:
        wrong = task_class.check(model, document.file)
        mistakes += [_at(origins.get(key, here), message) for key, message in wrong if certain or key in values]
    if mistakes:
        raise SettingsErrors(mistakes)
    return values


def _given(place: KeyPath, values: dict[str, Any]) -> bool:
    """Whether a mistake is in a value that stands somewhere, not in what is missing or in how values go together."""
    return bool(place) and place[0] in values


def _layers(document: Document, task: str, config: list[str]) -> tuple[list[Origin], list[SettingsError]]:
    """What is laid over each other, and what of it cannot be read."""
    layers: list[Origin] = []
    mistakes: list[SettingsError] = []
    opened: Document | None = None
    chosen = broken = False
    for index, word in enumerate(config):
        place: KeyPath = ("tasks", task, "config", index)
        try:
            if word.endswith((".yaml", ".yml")):
                layers += _default_section(opened, chosen)
                opened, chosen, broken = None, False, True
                opened, broken = _open(document, place, word), False
            elif opened is not None:
                chosen = True
                layers.append(_section(document, place, opened, word))
            elif not broken:  # else its file has been told of
                raise document.error(place, f"must be a .yaml file before its sections, got {word!r}")
        except SettingsErrors as errors:
            mistakes += errors.errors
        except SettingsError as error:
            mistakes.append(error)
    here = (document, ("tasks", task, "properties"))
    return [*layers, *_default_section(opened, chosen), here], mistakes


def _open(document: Document, place: KeyPath, word: str) -> Document:
    try:
        opened = load_yaml(find_file(word, document.file))
    except SettingsError as error:
        if error.line is not None or isinstance(error, SettingsErrors):
            raise
        raise document.error(place, f"{word}: {error.message}") from None
    if not isinstance(opened.data, dict):
        raise opened.error((), "must be a mapping of properties to values")
    sections = opened.data.get("sections", {})
    named = sections.items() if isinstance(sections, dict) else [("", sections)] if sections else []
    for name, section in named:
        if not (section is None or isinstance(section, dict)):
            place = ("sections", name) if name else ("sections",)
            raise opened.error(place, f"must be a mapping of keys to values, got {section!r}")
    return opened


def _default_section(opened: Document | None, chosen: bool) -> list[Origin]:
    if opened is None or chosen:
        return []
    if "sections" not in opened.data:
        return [(opened, ())]
    return [(opened, ("sections", "default"))] if "default" in (opened.data["sections"] or {}) else []


def _section(document: Document, place: KeyPath, opened: Document, word: str) -> Origin:
    sections = opened.data.get("sections") or {}
    if word not in sections:
        known = ", ".join(sections) or "none"
        raise document.error(place, f"{opened.file} has no section {word!r}{suggest(word, sections)}; it has: {known}")
    return opened, ("sections", word)


def _place(place: KeyPath, words: str, origins: dict[str, Origin], here: Origin) -> SettingsError:
    """A mistake at the file and line whose value counts."""
    if not place:
        return _at(here, words)
    layer, at = origins.get(str(place[0]), (here[0], (*here[1], place[0])))
    return _at((layer, (*at, *place[1:])), words)


def _at(origin: Origin, message: str) -> SettingsError:
    document, path = origin
    return document.error(path, message)
