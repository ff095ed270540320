"""A model's folder: model.config names the SDF file to read."""

from __future__ import annotations

from pathlib import Path

from sonar_component.scene.sdf.known import NEWEST
from sonar_component.scene.sdf.xml import read_xml
from sonar_component.settings import SettingsError


def model_file(path: Path) -> Path:
    """Return the SDF file of a model's folder: the newest that model.config offers and we read; a file is itself.

    Raises
    ------
    SettingsError
        When the folder holds no model.config and no model.sdf, or names a file that is not in it.
    """
    if not path.is_dir():
        return path
    config = path / "model.config"
    if not config.is_file():
        if (path / "model.sdf").is_file():
            return path / "model.sdf"
        raise SettingsError("is a folder without model.config", str(path))
    offered = [(_version(at.attributes.get("version", "")), at) for at in read_xml(config).all("sdf")]
    if not offered:
        raise SettingsError("names no <sdf> file", str(config))
    readable = [item for item in offered if item[0] <= NEWEST] or offered
    _, chosen = max(readable, key=lambda item: item[0])
    found = (path / chosen.text).resolve()
    if not found.is_file() or not found.is_relative_to(path.resolve()):
        raise chosen.error(f"must name a file in this folder, got {chosen.text!r}")
    return found


def _version(text: str) -> tuple[int, ...]:
    return tuple(int(part) if part.isdigit() else 0 for part in text.split("."))
