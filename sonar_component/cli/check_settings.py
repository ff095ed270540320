"""`sonar check` of what a deployment names: a sonar's settings, a scene.

Looked at only after a file has failed to be a deployment, so that a good deployment costs nothing more.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

_YAML = (".yaml", ".yml")


def check_named(path: Path) -> tuple[str, dict[str, Any], list[str]] | None:
    """What a sonar's or a scene's file comes to, in words and for machines, and what is odd about it.

    Returns
    -------
    (words, data, warnings), or None
        None if the file is neither, by its name and its keys.

    Raises
    ------
    SettingsError
        If it is wrong.
    """
    if path.suffix.lower() not in _YAML:
        return _scene(path)
    keys = _keys(path)
    if {"bodies", "include"} & keys and "tasks" not in keys:
        return _scene(path)
    if {"version", "tasks"} & keys or not keys:
        return None
    return _sonar(path, keys)


def _keys(path: Path) -> set[str]:
    from sonar_component.settings.errors import SettingsError
    from sonar_component.settings.loader import load_yaml

    try:
        data = load_yaml(path).data
    except SettingsError:
        return set()
    return {str(key) for key in data} if isinstance(data, dict) else set()


def _sonar(path: Path, keys: set[str]) -> tuple[str, dict[str, Any], list[str]] | None:
    from sonar_component.cli.ping import load_settings
    from sonar_component.sonars.scanning_settings import ScanningSettings
    from sonar_component.sonars.settings import ForwardLookingSettings

    if not keys & (ScanningSettings.model_fields.keys() | ForwardLookingSettings.model_fields.keys()):
        return None
    chosen = load_settings(path, [])
    beams = chosen.beam_count if isinstance(chosen, ForwardLookingSettings) else 1
    kind = chosen.kind.replace("_", "-")
    words = f"a {kind} sonar, {_count(beams, 'beam')} x {_count(chosen.bin_count, 'bin')} to {chosen.range:g} m"
    return words, {"sonar": chosen.model_dump(mode="json")}, chosen.doubts()


def _scene(path: Path) -> tuple[str, dict[str, Any], list[str]]:
    from sonar_component.scene import load_world
    from sonar_component.settings.errors import SettingsError

    try:
        world = load_world(path)
    except ValueError as error:
        raise error if isinstance(error, SettingsError) else SettingsError(str(error), str(path)) from None
    triangles = sum(len(part.mesh.faces) for body in world.bodies.values() for part in body.parts)
    words = f"a scene of {_count(len(world.bodies), 'body', 'bodies')}, {_count(triangles, 'triangle')}"
    return words, {"bodies": list(world.bodies), "triangles": triangles}, list(world.warnings)


def _count(number: int, one: str, many: str = "") -> str:
    return f"{number} {one if number == 1 else many or one + 's'}"
