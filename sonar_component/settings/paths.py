"""Where files named in a deployment, a scene or on the command line are looked for."""

from __future__ import annotations

from pathlib import Path

from sonar_component.settings.errors import SettingsError, suggest

_PACKAGE = Path(__file__).resolve().parent.parent


def data_root() -> Path:
    """Folder that holds ``configs`` and ``deploy``: inside an installed wheel, or the top of a checkout."""
    installed = _PACKAGE / "data"
    return installed if installed.is_dir() else _PACKAGE.parent


def find_file(ref: str | Path, beside: str | Path | None = None) -> Path:
    """Resolve a file reference.

    Looked for, in this order: as an absolute path; beside the file that names it and in that file's parent folders;
    in the working directory; among the files that come with the package.

    Raises
    ------
    SettingsError
        If it is in none of these places; names the nearest file that exists.
    """
    path = _expand(ref)
    if path.is_absolute():
        places = [path]
    else:
        folders = [Path.cwd(), data_root()]
        if beside is not None:
            start = Path(beside).resolve().parent
            folders = [start, *list(start.parents)[:3], *folders]
        places = [folder / path for folder in dict.fromkeys(folders)]
    for place in places:
        if _exists(place):
            return place
    siblings = [name for place in places for name in _names_in(place.parent)]
    tried = ", ".join(str(folder) for folder in dict.fromkeys(str(place.parent) for place in places))
    raise SettingsError(f"no such file{suggest(path.name, siblings)}; looked in {tried}", str(ref))


def _expand(ref: str | Path) -> Path:
    try:
        return Path(ref).expanduser()
    except RuntimeError:  # no such user, or no home
        return Path(ref)


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):  # a name too long, or one that no file can have
        return False


def _names_in(folder: Path) -> list[str]:
    try:
        return sorted(entry.name for entry in folder.iterdir())
    except (OSError, ValueError):
        return []
