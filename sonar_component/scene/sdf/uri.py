"""References to files from SDF: model://, package://, file:// and relative ones, kept inside the search path.

A world from somewhere else must not make us read any file it likes: whatever a reference resolves to has to lie in a
folder of the search path, in the folder of the world itself, or beside it when worlds and models stand in folders next
to each other.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import unquote

VARIABLES = (
    "SDF_PATH",
    "GZ_SIM_RESOURCE_PATH",
    "IGN_GAZEBO_RESOURCE_PATH",
    "GAZEBO_MODEL_PATH",
    "GAZEBO_RESOURCE_PATH",
)
_WORLD_FOLDERS = ("world", "worlds", "sdf")  # beside which models usually stand


class SearchPath:
    """Folders in which models are looked for, in order."""

    def __init__(self, world_file: Path, folders: Sequence[str | Path] = ()) -> None:
        listed = [Path(folder).expanduser() for folder in folders]
        for variable in VARIABLES:
            listed += [Path(folder) for folder in os.environ.get(variable, "").split(os.pathsep) if folder]
        home = world_file.resolve().parent
        project = home.parent if home.name.lower() in _WORLD_FOLDERS or (home / "model.config").is_file() else home
        listed += [home, home / "models", project, project / "models"]
        self.folders = list(dict.fromkeys(folder.resolve() for folder in listed if folder.is_dir()))

    def find(self, uri: str, beside: str) -> Path:
        """Resolve a reference that stands in the file `beside`.

        Raises
        ------
        ValueError
            When nothing is there, when it lies outside the search path, or when it would have to be downloaded.
        """
        candidates = self._candidates(unquote(uri), Path(beside).resolve().parent)
        found = next((place for place in candidates if place.exists()), None)
        if found is None:
            raise ValueError(f"{uri!r} is not there; looked in {', '.join(map(str, self.folders))}")
        resolved = found.resolve()  # also through symbolic links
        if not any(resolved.is_relative_to(folder) for folder in self.folders):
            raise ValueError(f"{uri!r} lies outside the search path; allowed: {', '.join(map(str, self.folders))}")
        return resolved

    def _candidates(self, uri: str, folder: Path) -> list[Path]:
        scheme, _, rest = uri.partition("://")
        if not rest:
            return [folder / uri, *(place / uri for place in self.folders)]
        if scheme in ("model", "package"):
            return [place / rest for place in self.folders]
        if scheme == "file":
            path = Path(rest)
            return [path] if path.is_absolute() else [folder / path, *(place / path for place in self.folders)]
        if scheme in ("http", "https"):
            # Gazebo would download it; a copy that stands in the search path under the model's name will do.
            return [place / Path(rest).name for place in self.folders]
        raise ValueError(f"{uri!r} must begin with model://, file:// or be a path")
