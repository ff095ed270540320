"""A user's mistake: where it is, what is allowed, what was got."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class SettingsError(ValueError):
    """One mistake in a file or on the command line, printed as ``file:line:column: key: message``."""

    def __init__(
        self, message: str, file: str | None = None, line: int | None = None, column: int | None = None, key: str = ""
    ) -> None:
        self.message, self.file, self.line, self.column, self.key = message, file, line, column, key
        place = ":".join(str(part) for part in (file, line, column) if part is not None)
        super().__init__(": ".join(part for part in (place, key, message) if part))


class SettingsErrors(SettingsError):
    """All mistakes of one file at once, so that they can be mended in one go."""

    def __init__(self, errors: Iterable[SettingsError]) -> None:
        self.errors = list(errors)
        super().__init__("\n".join(str(error) for error in self.errors))


def nearest(name: str, allowed: Iterable[str]) -> str:
    """The allowed name that was most likely meant, or the empty string."""
    near = difflib.get_close_matches(name, list(allowed), n=1, cutoff=0.5)
    return near[0] if near else ""


def suggest(name: str, allowed: Iterable[str]) -> str:
    """`` (did you mean "x"?)`` for the nearest allowed name, or the empty string."""
    near = nearest(name, allowed)
    return f' (did you mean "{near}"?)' if near else ""
