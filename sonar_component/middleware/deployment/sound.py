"""What is left of a deployment file without its structural mistakes, so that the rest of it can be checked too.

A wrong word or unit is taken out, or replaced by something that nobody complains of, and the file is read again. What
was taken out is remembered: whatever depends on it is not asked for, since one mistake must not be told twice.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from pydantic import ValidationError

from sonar_component.middleware.deployment.file import DeploymentFile
from sonar_component.settings.errors import SettingsError, SettingsErrors, nearest
from sonar_component.settings.loader import Document, KeyPath
from sonar_component.settings.validation import explain, fields_at

UNSOUND = "\0"  # stands for a name that cannot be read; no YAML file can hold it
_CHOICES = ("activity", "policy", "clock")  # without an unknown key, one of these would lack something


@dataclass
class Sound:
    """A file that can be read, and what is wrong with the one that was written.

    Attributes
    ----------
    document : without the mistakes.
    file : None where too little is left.
    mistakes : found so far.
    taken : key paths whose values were taken out.
    """

    document: Document
    file: DeploymentFile | None = None
    mistakes: list[SettingsError] = field(default_factory=list)
    taken: set[KeyPath] = field(default_factory=set)

    def lacks(self, *path: str | int) -> bool:
        """Whether something at, above or below this key path was taken out."""
        return any(path[: len(taken)] == taken[: len(path)] for taken in self.taken)


def sound_part(document: Document) -> Sound:
    """Read what can be read."""
    if not isinstance(document.data, dict):
        raise SettingsErrors([document.error((), f"must be a mapping of keys to values, got {document.data!r}")])
    sound = Sound(Document(copy.deepcopy(document.data), document.file, dict(document.positions), document.overrides))
    _name_by_text(sound, sound.document.data)
    told: list[tuple[KeyPath, str]] = []
    while found := [mistake for mistake in _read(sound) if mistake not in told]:
        told += found
        sound.mistakes += [sound.document.error(place, words) for place, words in found]
        if not all([_mend(sound, place) for place, _ in found]):
            break
    return sound


def _name_by_text(sound: Sound, value: Any, path: KeyPath = ()) -> None:
    """Take out what is named by a number or the like; of a property's value its task decides."""
    if path[:1] == ("tasks",) and path[2:3] == ("properties",) and len(path) > 3:
        return
    if isinstance(value, dict):
        for key in [key for key in value if not isinstance(key, str)]:
            text = str(key) if isinstance(key, (int, float)) and not isinstance(key, bool) else str(key).lower()
            sound.mistakes.append(sound.document.error((*path, text), f"must be named by a text, got {key!r}"))
            del value[key]
        for key, below in value.items():
            _name_by_text(sound, below, (*path, key))
    if isinstance(value, list):
        for index, below in enumerate(value):
            _name_by_text(sound, below, (*path, index))


def _read(sound: Sound) -> list[tuple[KeyPath, str]]:
    """Build the model, or say what is wrong."""
    try:
        sound.file = DeploymentFile.model_validate(sound.document.data)
    except ValidationError as error:
        return _found(sound.document.data, error)
    return []


def in_order(errors: Iterable[SettingsError], file: str) -> SettingsErrors:
    """Each mistake once, line by line, those of the deployment file first."""
    once = {str(error): error for error in errors}.values()
    return SettingsErrors(sorted(once, key=lambda e: (e.file != file, e.file or "", e.line or 0, e.column or 0)))


def _found(data: Any, error: ValidationError) -> list[tuple[KeyPath, str]]:
    """The mistakes; of unknown keys those alone, since what is missing beside them may be what they meant."""
    found = explain(DeploymentFile, data, error.errors())
    unknown = [(place, words) for place, words in found if words.startswith("is not a known key")]
    return unknown or found


def _mend(sound: Sound, place: KeyPath) -> bool:
    """Take a mistake out; False where nothing would be left."""
    if any(place[: len(taken)] == taken for taken in sound.taken):
        return True  # with another one beside it
    parent = sound.document.at(place[:-1])
    if isinstance(parent, dict) and place[-1] in parent and not _is_known(place):
        if _rename(sound.document, place):
            return True
        parent.pop(place[-1])
        if len(place) < 2 or place[-2] not in _CHOICES:
            return True
        place = place[:-1]
    taken = _take_out(sound.document.data, place)
    sound.taken.add(taken)
    return bool(taken)


def _is_known(place: KeyPath) -> bool:
    names = fields_at(DeploymentFile, place[:-1])
    return not names or isinstance(place[-1], int) or place[-1] in [*names, "from"]


def _rename(document: Document, place: KeyPath) -> bool:
    """Go on with what an unknown key most likely meant; False where that is not known, or stands there already."""
    parent, meant = document.at(place[:-1]), nearest(str(place[-1]), fields_at(DeploymentFile, place[:-1]))
    if not meant or meant in parent:
        return False
    parent[meant] = parent.pop(place[-1])
    for path, position in list(document.positions.items()):
        if path[: len(place)] == place:
            document.positions[(*place[:-1], meant, *path[len(place) :])] = position
    return True


def _take_out(data: Any, place: KeyPath) -> KeyPath:
    """Remove or replace the smallest part around a place that the file can be read without; its key path."""
    match place:
        case ("version", *_):
            data["version"] = 1
        case ("tasks", name):
            data["tasks"][name] = {"type": UNSOUND}
        case ("tasks", name, "type", *_):
            data["tasks"][name]["type"] = UNSOUND
        case ("tasks", name, key, *_):
            data["tasks"][name].pop(key, None)
            return place[:3]
        case ("hosts", name, *_):
            data["hosts"][name] = {"address": "localhost"}
        case ("connections", int(index), *below):
            return _take_out_connection(data["connections"], index, below)
        case (str(key), *_) if key != "tasks":
            data.pop(key, None)
            return (key,)
        case _:
            return ()
    return place


def _take_out_connection(connections: list[Any], index: int, below: list[Any]) -> KeyPath:
    match below:
        case []:
            connections[index] = {"from": UNSOUND, "to": [UNSOUND]}
        case ["from" | "source", *_]:
            connections[index]["from"] = UNSOUND
        case ["to", int(number), *_]:
            connections[index]["to"][number] = UNSOUND
        case ["to", *_]:
            connections[index]["to"] = [UNSOUND]
        case _:
            connections[index].pop(below[0], None)
    return ("connections", index, *below[:2])
