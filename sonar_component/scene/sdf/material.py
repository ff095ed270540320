"""<material> and our own elements to Material.

    <visual name="hull">
      <material>
        <script><name>Gazebo/Rust</name></script>
        <pbr><metal><normal_map>plates.png</normal_map></metal></pbr>
        <sonar:reflectance>1.4</sonar:reflectance>
      </material>
    </visual>

`sonar:reflectance` may also stand in a visual, a link or a model, for all that is inside; the innermost counts. Colours
and textures are for eyes and change nothing here.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sonar_component.scene.body import Part
from sonar_component.scene.material import Material
from sonar_component.scene.sdf.numbers import positive
from sonar_component.scene.sdf.uri import SearchPath
from sonar_component.scene.sdf.xml import Element
from sonar_component.scene.texture import read_image

REFLECTANCE = "sonar:reflectance"


@dataclass
class Materials:
    """Materials of one world; pictures are read once, and equal materials are one."""

    search: SearchPath
    pictures: dict[Path, NDArray[np.uint8]] = field(default_factory=dict)
    made: dict[tuple[object, ...], Material] = field(default_factory=dict)

    def dressed(self, parts: list[Part], visual: Element, reflectance: float | None) -> list[Part]:
        """Return the parts with what a visual says of their material; what it leaves open stays as in the mesh file.

        Raises
        ------
        SettingsError
            When the reflectance is not greater than 0, or the normal map is not a picture in the search path.
        """
        material = visual.first("material")
        chosen = reflectance_of(material) or reflectance_of(visual) or reflectance
        name = material.text_at("script", "name") if material is not None else ""
        picture = self._normal_map(material) if material is not None else None
        if not name and chosen is None and picture is None:
            return parts
        return [replace(part, material=self._changed(part.material, name, chosen, picture)) for part in parts]

    def _changed(self, old: Material, name: str, reflectance: float | None, picture: Path | None) -> Material:
        key = (id(old), name, reflectance, picture)
        if key not in self.made:
            normal_map = old.normal_map if picture is None else self.pictures[picture]
            self.made[key] = Material(name or old.name, reflectance or old.reflectance, normal_map, old.reflectance_map)
        return self.made[key]

    def _normal_map(self, material: Element) -> Path | None:
        places = (("pbr", "metal", "normal_map"), ("pbr", "specular", "normal_map"), ("shader", "normal_map"))
        at = next((found for place in places if (found := material.first(*place)) is not None and found.text), None)
        if at is None:
            return None
        try:
            path = self.search.find(at.text, at.file)
            if path not in self.pictures:
                self.pictures[path] = read_image(path, "RGB")
        except ValueError as error:
            raise at.error(str(error)) from None
        return path


def reflectance_of(element: Element | None) -> float | None:
    """Return the reflectance R [-] that stands directly in an element, or None."""
    at = element.first(REFLECTANCE) if element is not None else None
    return positive(at, 1, "a reflectance")[0] if at is not None else None
