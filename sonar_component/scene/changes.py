"""Bodies and materials that come while a world runs, in the words of the scene YAML."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from sonar_component.scene.body import Body
from sonar_component.scene.material import Material
from sonar_component.scene.scene_file import read_scene
from sonar_component.scene.world import World
from sonar_component.settings import Document, SettingsError


def make_body(
    world: World, name: str, settings: Mapping[str, Any], beside: Path, search_path: Sequence[str | Path] = ()
) -> Body:
    """Make a body as ``bodies`` of a scene YAML describes it; it is not put into the world yet.

    Parameters
    ----------
    world : whose materials may be named, and which hears what was repaired or left out.
    settings : such as ``{"mesh": "buoy.glb", "pose": {"position": [1, 2, 3]}, "moving": True}``.
    beside : file beside which files are looked for.

    Raises
    ------
    SettingsError
        By key, as for a scene file.
    """
    data = {"version": 1, "bodies": {name: dict(settings)}}
    made = read_scene(Document(data, "spawn"), beside, search_path, materials_of(world))
    world.warnings += [line for line in made.warnings if line not in world.warnings]
    return made.bodies[name]


def make_material(world: World, body: str, settings: str | Mapping[str, Any], beside: Path) -> Material:
    """Make a material as ``material`` of a body in a scene YAML describes it, or find one of the world by its name.

    Raises
    ------
    SettingsError
        By key, as for a scene file.
    """
    if not isinstance(settings, str) and "texture_size" in settings:
        raise SettingsError("material: texture_size belongs to the mesh: give it where the body is made")
    # The box is only a way to say it: the reader of scenes takes materials of bodies.
    box = {"box": {"size": [1, 1, 1]}, "material": settings if isinstance(settings, str) else dict(settings)}
    data = {"version": 1, "bodies": {body: box}}
    try:
        made = read_scene(Document(data, "set_material"), beside, (), materials_of(world))
    except SettingsError as error:
        raise SettingsError(str(error).replace(f"bodies.{body}.material", "material")) from None
    return made.bodies[body].parts[0].material


def materials_of(world: World) -> dict[str, Material]:
    """Materials of a world by name; of several with one name, the first."""
    parts = [part for body in world.bodies.values() for part in body.parts]
    return {part.material.name: part.material for part in reversed(parts)}
