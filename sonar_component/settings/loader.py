"""Strict YAML: positions kept, duplicate keys refused, numbers as in YAML 1.2.

PyYAML reads YAML 1.1, where ``1e-3`` is text, ``010`` is 8, ``12:30`` is 750, ``no`` is false and a repeated key
silently wins. A configuration must not hold such traps, so this loader resolves the YAML 1.2 core schema. ruamel.yaml
was looked at: it reads 1.2, but keeps positions only on its round-trip types, which then leak into every model. So was
libyaml, which takes 0.4 ms instead of 2 ms for a file of ours: not every PyYAML has it, and it takes files that the
other parser refuses, so a deployment would be good on one machine only.
"""

from __future__ import annotations

import copy
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from sonar_component.settings.errors import SettingsError, SettingsErrors

KeyPath = tuple[str | int, ...]


class _Loader(yaml.SafeLoader):
    """SafeLoader with the scalar rules of YAML 1.2's core schema."""


_FLOAT = r"[-+]?(?:\.\d+|\d+(?:\.\d*)?)(?:[eE][-+]?\d+)?|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)"
_CORE_SCHEMA = (  # tag, pattern of the whole scalar, its possible first characters
    ("bool", r"true|True|TRUE|false|False|FALSE", [*"tTfF"]),
    ("int", r"[-+]?\d+|0o[0-7]+|0x[0-9a-fA-F]+", [*"-+0123456789"]),
    ("float", _FLOAT, [*"-+.0123456789"]),
    ("null", r"~|null|Null|NULL|", [*"~nN", ""]),
)


def _construct_int(loader: Any, node: Any) -> int:
    text = loader.construct_scalar(node)
    return int(text, {"0o": 8, "0x": 16}.get(text[:2], 10))  # 010 is ten


def _construct_float(loader: Any, node: Any) -> float:
    return float(loader.construct_scalar(node).lower().replace(".inf", "inf").replace(".nan", "nan"))


_Loader.yaml_implicit_resolvers = {}
for _name, _pattern, _first in _CORE_SCHEMA:
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_name}", re.compile(f"^(?:{_pattern})$"), _first)
_Loader.add_constructor("tag:yaml.org,2002:int", _construct_int)
_Loader.add_constructor("tag:yaml.org,2002:float", _construct_float)


@dataclass
class Document:
    """A loaded file: plain data, and where each of its keys stands.

    Attributes
    ----------
    data : dict or list
        Plain Python values.
    file : str
        Name for messages, as the user wrote it.
    positions : dict
        Key path -> (line, column), counted from 1.
    overrides : dict
        Key path -> where its value came from instead of the file, such as ``--set``.
    """

    data: Any
    file: str
    positions: dict[KeyPath, tuple[int, int]] = field(default_factory=dict)
    overrides: dict[KeyPath, str] = field(default_factory=dict)

    def position(self, path: KeyPath) -> tuple[int, int]:
        """Line and column of a key, or of the nearest parent that stands in the file."""
        while path and path not in self.positions:
            path = path[:-1]
        return self.positions.get(path, (1, 1))

    def error(self, path: KeyPath, message: str) -> SettingsError:
        """A SettingsError at that key."""
        if path in self.overrides:  # its line in the file is not the one at fault
            return SettingsError(message, self.overrides[path], key=".".join(map(str, path)))
        line, column = self.position(path)
        return SettingsError(message, self.file, line, column, ".".join(str(part) for part in path))

    def at(self, path: KeyPath) -> Any:
        """The value at that key path, or None if it is not there."""
        value = self.data
        try:
            for part in path:
                value = value[part]
        except (KeyError, IndexError, TypeError):
            return None
        return value


def load_yaml(path: str | Path, text: str | None = None, repeated: list[SettingsError] | None = None) -> Document:
    """Read one YAML document (or ``text`` in the name of ``path``).

    Parameters
    ----------
    repeated : is given the keys that stand twice, of which the first then counts, by a caller who looks for more.

    Raises
    ------
    SettingsError
        If the file cannot be read, is not YAML, or repeats a key.
    """
    twice: list[SettingsError] = [] if repeated is None else repeated
    file = str(path)
    if text is None:
        try:
            text = Path(path).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise SettingsError(f"cannot be read: {getattr(error, 'strerror', None) or error}", file) from None
    try:
        data, positions = _read(text, file, twice)
    except SettingsError:
        raise
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line, column = (mark.line + 1, mark.column + 1) if mark else (None, None)
        words = " ".join(part for part in (error.context, error.problem) if part)
        raise SettingsError(f"is not YAML: {words}", file, line, column) from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise SettingsError(f"is not YAML: {str(error).splitlines()[0]}", file) from None
    if twice and repeated is None:
        raise twice[0] if len(twice) == 1 else SettingsErrors(twice)
    return Document(data, file, positions)


def _read(text: str, file: str, twice: list[SettingsError]) -> tuple[Any, dict[KeyPath, tuple[int, int]]]:
    """The data, and where each key stands."""
    loader = _Loader(text)
    positions: dict[KeyPath, tuple[int, int]] = {}
    try:
        node = loader.get_single_node()
        if node is None:
            return None, positions
        _Walk(file, positions, twice).walk(node, ())
        return loader.construct_document(node), positions
    finally:
        loader.dispose()


def overlay(document: Document, settings: list[str], source: str) -> Document:
    """The document with ``NAME=VALUE`` texts laid over it; a dot in NAME goes one level down, VALUE is YAML.

    Raises
    ------
    SettingsError
        If a text has not that form, or goes below something that has no keys.
    """
    fault = document.error((), f"must be a mapping of keys to values, got {document.data!r}")
    data = _mapping(copy.deepcopy(document.data), fault)
    overrides = dict(document.overrides)
    for setting in settings:
        name, equals, value = setting.partition("=")
        if not (equals and name):
            raise SettingsError(f"must be NAME=VALUE, got {setting!r}", source)
        path = tuple(name.split("."))
        below = data
        for depth, part in enumerate(path[:-1], start=1):
            parent = ".".join(path[:depth])
            below[part] = _mapping(below.get(part), SettingsError("has no keys below it", source, key=parent))
            below = below[part]
        below[path[-1]] = load_yaml(source, value).data
        overrides[path] = source
    return Document(data, document.file, document.positions, overrides)


def _mapping(value: Any, fault: SettingsError) -> dict[str, Any]:
    """The value if it has keys, an empty mapping for None."""
    if value is not None and not isinstance(value, dict):
        raise fault
    return value or {}


_MAX_DEPTH = 50  # [-], far above any file of ours; bounds what an alias can unfold


@dataclass
class _Walk:
    """Notes where each key stands; leaves out repeated keys and refuses endless nesting."""

    file: str
    positions: dict[KeyPath, tuple[int, int]]
    twice: list[SettingsError]

    def walk(self, node: yaml.Node, path: KeyPath, depth: int = 0) -> None:
        if depth > _MAX_DEPTH or len(self.positions) > 100_000:
            line, column = _start(node)
            raise SettingsError("is nested too deeply", self.file, line, column)
        self.positions.setdefault(path, _start(node))
        if isinstance(node, yaml.SequenceNode):
            for index, child in enumerate(node.value):
                self.walk(child, (*path, index), depth + 1)
        if isinstance(node, yaml.MappingNode):
            node.value = [pair for pair in node.value if self._is_new(pair, path, depth)]

    def _is_new(self, pair: tuple[yaml.Node, yaml.Node], path: KeyPath, depth: int) -> bool:
        key, child = pair
        below = (*path, str(key.value))
        if below in self.positions:
            line, column = _start(key)
            message = f"stands twice, first in line {self.positions[below][0]}"
            self.twice.append(SettingsError(message, self.file, line, column, ".".join(map(str, below))))
            return False
        self.positions[below] = _start(key)
        self.walk(child, below, depth + 1)
        return True


def _start(node: yaml.Node) -> tuple[int, int]:
    return node.start_mark.line + 1, node.start_mark.column + 1
