"""<material> and our own elements to Material.

    <visual name="hull">
      <material>
        <script><name>Gazebo/Rust</name></script>
        <pbr><metal><normal_map>plates.png</normal_map></metal></pbr>
        <sonar:reflectance>1.4</sonar:reflectance>
        <sonar:reflectance_map>rust.png</sonar:reflectance_map>
      </material>
    </visual>

`sonar:reflectance_map` is a grey picture: white keeps the reflectance, black mutes it. `sonar:reflectance` may also
stand in a visual, a link or a model, for all that is inside; the innermost counts. Colours and textures are for eyes
and change nothing here.
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
REFLECTANCE_MAP = "sonar:reflectance_map"
_NORMAL_MAPS = (("pbr", "metal", "normal_map"), ("pbr", "specular", "normal_map"), ("shader", "normal_map"))

Picture = NDArray[np.uint8] | None


@dataclass
class Materials:
    """Materials of one world; pictures are read once, and equal materials are one."""

    search: SearchPath
    pictures: dict[tuple[Path, str], NDArray[np.uint8]] = field(default_factory=dict)
    made: dict[tuple[object, ...], Material] = field(default_factory=dict)

    def dressed(self, parts: list[Part], visual: Element, reflectance: float | None) -> list[Part]:
        """Return the parts with what a visual says of their material; what it leaves open stays as in the mesh file.

        Raises
        ------
        SettingsError
            When the reflectance is not greater than 0, or a map is not a picture in the search path.
        """
        material = visual.first("material")
        chosen = reflectance_of(material) or reflectance_of(visual) or reflectance
        name = material.text_at("script", "name") if material is not None else ""
        normal_map = self._picture(material, _NORMAL_MAPS, "RGB")
        reflectance_map = self._picture(material, ((REFLECTANCE_MAP,),), "L")
        if not name and chosen is None and normal_map is None and reflectance_map is None:
            return parts
        return [
            replace(part, material=self._changed(part.material, name, chosen, normal_map, reflectance_map))
            for part in parts
        ]

    def _changed(
        self, old: Material, name: str, reflectance: float | None, normal_map: Picture, reflectance_map: Picture
    ) -> Material:
        key = (id(old), name, reflectance, id(normal_map), id(reflectance_map))
        if key not in self.made:
            self.made[key] = Material(
                name or old.name,
                reflectance or old.reflectance,
                old.normal_map if normal_map is None else normal_map,
                old.reflectance_map if reflectance_map is None else reflectance_map,
            )
        return self.made[key]

    def _picture(self, material: Element | None, places: tuple[tuple[str, ...], ...], mode: str) -> Picture:
        """The first picture that a material names at these places; None where it names none."""
        if material is None:
            return None
        at = next((found for place in places if (found := material.first(*place)) is not None and found.text), None)
        if at is None:
            return None
        try:
            path = self.search.find(at.text, at.file)
            if (path, mode) not in self.pictures:
                self.pictures[path, mode] = read_image(path, mode)
        except ValueError as error:
            raise at.error(str(error)) from None
        return self.pictures[path, mode]


def reflectance_of(element: Element | None) -> float | None:
    """Return the reflectance R [-] that stands directly in an element, or None."""
    at = element.first(REFLECTANCE) if element is not None else None
    return positive(at, 1, "a reflectance")[0] if at is not None else None
