"""XML files as plain elements that know their file and line."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.parsers import expat

from sonar_component.settings import SettingsError

MAX_BYTES = 64 << 20  # [B], the largest worlds in use have a few
MAX_DEPTH = 100  # [-], Gazebo's own files stay below 20


@dataclass
class Element:
    """One element.

    Attributes
    ----------
    tag : with its prefix, such as "sonar:reflectance".
    attributes : name -> value.
    file, line : where it begins.
    text : character data directly inside, stripped.
    children : in order.
    """

    tag: str
    attributes: dict[str, str]
    file: str
    line: int
    text: str = ""
    children: list[Element] = field(default_factory=list)

    def all(self, tag: str) -> Iterator[Element]:
        """Children with that tag."""
        return (child for child in self.children if child.tag == tag)

    def first(self, *path: str) -> Element | None:
        """The first element down that path, or None."""
        found: Element | None = self
        for tag in path:
            found = next(found.all(tag), None) if found is not None else None
        return found

    def text_at(self, *path: str) -> str:
        """Text of the first element down that path, or the empty string."""
        found = self.first(*path)
        return found.text if found is not None else ""

    def error(self, message: str) -> SettingsError:
        """An error at this element."""
        return SettingsError(message, self.file, self.line, key=f"<{self.tag}>")


def read_xml(path: Path) -> Element:
    """Read a file; its root element.

    Raises
    ------
    SettingsError
        When it cannot be read, is too large or too deep, is not XML, or declares a document type.
    """
    file = str(path)
    try:
        if path.stat().st_size > MAX_BYTES:
            raise SettingsError(f"is too large: at most {MAX_BYTES >> 20} MiB", file)
        data = path.read_bytes()
    except OSError as error:
        raise SettingsError(f"cannot be read: {error.strerror}", file) from None
    builder = _Builder(file)
    try:
        builder.parser.Parse(data, True)
    except expat.ExpatError as error:
        message = f"is not XML: {expat.ErrorString(error.code)}"
        raise SettingsError(message, file, error.lineno, error.offset + 1) from None
    return builder.root.children[0]


class _Builder:
    """Handlers that grow the tree."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.root = Element("", {}, file, 1)
        self.open = [self.root]
        self.parser: Any = expat.ParserCreate()
        self.parser.buffer_text = True
        self.parser.StartElementHandler = self.start
        self.parser.EndElementHandler = self.end
        self.parser.CharacterDataHandler = self.characters
        self.parser.StartDoctypeDeclHandler = self.doctype

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        line = self.parser.CurrentLineNumber
        if len(self.open) > MAX_DEPTH:
            raise SettingsError(f"is nested deeper than {MAX_DEPTH} elements", self.file, line)
        element = Element(tag, attributes, self.file, line)
        self.open[-1].children.append(element)
        self.open.append(element)

    def end(self, _tag: str) -> None:
        element = self.open.pop()
        element.text = element.text.strip()

    def characters(self, data: str) -> None:
        self.open[-1].text += data

    def doctype(self, *_: object) -> None:
        # Entities live in document types; a few lines of them can grow to gigabytes. No SDF needs one.
        line = self.parser.CurrentLineNumber
        raise SettingsError(
            "declares a document type, which is not read because it can hold an entity bomb", self.file, line
        )
