"""Reads a scene YAML into a World.

version: 1
materials:
  steel: {reflectance: 1.4, normal_map: plates.png}
bodies:
  wreck: {mesh: wreck.glb, pose: {position: [14 m, 0, -6 m], rpy: [0, 0, 30 deg]}, material: steel}
  buoy: {sphere: {radius: 0.4 m}, moving: true}
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from sonar_component.scene import pose, shapes
from sonar_component.scene.body import Body, Part
from sonar_component.scene.box_mapping import box_mapped
from sonar_component.scene.material import Material
from sonar_component.scene.mesh import Mesh
from sonar_component.scene.mesh_file import MeshOptions, read_mesh_file
from sonar_component.scene.scene_settings import BodySettings, MaterialSettings, PoseSettings, SceneSettings
from sonar_component.scene.sdf.world import read_sdf
from sonar_component.scene.terrain import read_heights, terrain
from sonar_component.scene.texture import read_image
from sonar_component.scene.world import World
from sonar_component.settings import Document, SettingsError, SettingsErrors, find_file, load_yaml, validate
from sonar_component.settings.errors import suggest


def read_scene_file(path: Path, search_path: Sequence[str | Path] = ()) -> World:
    """Read a scene YAML with everything that it names; `search_path` is for model:// references of SDF.

    Raises
    ------
    SettingsErrors
        All mistakes at once, each with file, line and key: unknown keys, missing or broken meshes, unknown materials.
    """
    return read_scene(load_yaml(path), path, search_path)


def read_scene(
    document: Document,
    path: Path,
    search_path: Sequence[str | Path] = (),
    materials: Mapping[str, Material] | None = None,
) -> World:
    """Read a scene from a document, with files looked for beside `path`; `materials` may be named besides its own."""
    return _Reader(path, document, validate(SceneSettings, document), search_path, materials or {}).world()


class _Reader:
    """One reading of one file: collects mistakes, so that all are told at once."""

    def __init__(
        self,
        path: Path,
        document: Document,
        settings: SceneSettings,
        search_path: Sequence[str | Path],
        given: Mapping[str, Material],
    ) -> None:
        self.path, self.document, self.settings, self.search_path = path, document, settings, search_path
        self.given = given
        self.errors: list[SettingsError] = []
        self.warnings: list[str] = []
        self.materials: dict[str, Material] = {}
        self._texture_sizes: dict[Material, float] = {}
        self._box_mapped: dict[tuple[Mesh, float], Mesh] = {}
        self._merged: dict[tuple[int, int], Material] = {}

    def world(self) -> World:
        for name, settings in self.settings.materials.items():
            self._try(("materials", name), self._add_material, name, settings)
        bodies: list[Body] = []
        for index, name in enumerate(self.settings.include):
            bodies += self._try(("include", index), self._included, name) or []
        for name, body in self.settings.bodies.items():
            bodies.append(self._try(("bodies", name), self._body, name, body))
        if self.errors:
            raise SettingsErrors(self.errors)
        world = World(warnings=self.warnings)
        for made in bodies:
            self._try(("bodies", made.name), world.add, made)
        if self.errors:
            raise SettingsErrors(self.errors)
        return world

    def _try(self, key: tuple[str | int, ...], make: Callable[..., Any], *arguments: object) -> Any:
        """Return what `make` makes, or note its error at `key` unless it already knows its line."""
        try:
            return make(*arguments)
        except SettingsErrors as errors:
            self.errors.extend(errors.errors)
        except SettingsError as error:
            self.errors.append(error if error.line is not None else self.document.error(key, str(error)))
        except ValueError as error:
            self.errors.append(self.document.error(key, str(error)))
        return None

    def _add_material(self, name: str, settings: MaterialSettings) -> None:
        self.materials[name] = self._material(name, settings)

    def _material(self, name: str, settings: MaterialSettings) -> Material:
        normal_map, reflectance_map = settings.normal_map, settings.reflectance_map
        made = Material(
            name,
            settings.reflectance,
            None if normal_map is None else read_image(find_file(normal_map, self.path), "RGB"),
            None if reflectance_map is None else read_image(find_file(reflectance_map, self.path), "L"),
        )
        if settings.texture_size is not None:
            self._texture_sizes[made] = settings.texture_size
        return made

    def _chosen(self, key: tuple[str, ...], choice: str | MaterialSettings) -> Material:
        if isinstance(choice, MaterialSettings):
            return self._material(key[-1] if key[-2] == "materials" else key[1], choice)
        known = {**self.given, **self.settings.materials}
        if choice not in known:
            hint = suggest(choice, known) or f"; materials: {', '.join(known) or 'none'}"
            raise self.document.error(key, f'no material "{choice}" in this file{hint}')
        # One that could not be read has been told already; a stand-in lets the rest be checked.
        return self.materials.get(choice) or self.given.get(choice) or Material(choice)

    def _body(self, name: str, settings: BodySettings) -> Body:
        parts = self._parts(name, settings)
        by_name = {
            wanted: self._chosen(("bodies", name, "materials", wanted), choice)
            for wanted, choice in settings.materials.items()
        }
        for wanted in by_name:
            present = {part.material.name for part in parts} | {part.name for part in parts}
            if wanted not in present:
                key = ("bodies", name, "materials", wanted)
                raise self.document.error(key, f"no material or part of that name in it; it has {_listed(present)}")
        everywhere = None
        if settings.material is not None:
            everywhere = self._chosen(("bodies", name, "material"), settings.material)
        # Looked up by the file's own names: a part's name is more particular than its material's.
        chosen = [by_name.get(p.name, by_name.get(p.material.name, everywhere)) for p in parts]
        return Body(name, self._dressed(parts, chosen), to_pose(settings.pose), settings.moving)

    def _dressed(self, parts: list[Part], chosen: Sequence[Material | None]) -> list[Part]:
        """Give each part its chosen material, or the scene's material of the same name where nothing is chosen."""
        dressed = []
        for part, choice in zip(parts, chosen, strict=True):
            new, old = choice or self.materials.get(part.material.name), part.material
            if new is None:
                dressed.append(part)
                continue
            size = self._texture_sizes.get(new)
            mesh = part.mesh if size is None else self._laid_on(part.mesh, size)
            if any(brought is not None for brought in (old.normal_map, old.reflectance_map)):
                new = self._merged.setdefault((id(new), id(old)), _over(new, old))
            dressed.append(replace(part, material=new, mesh=mesh))
        return dressed

    def _laid_on(self, mesh: Mesh, size: float) -> Mesh:
        if (mesh, size) not in self._box_mapped:
            self._box_mapped[mesh, size] = box_mapped(mesh, size)
        return self._box_mapped[mesh, size]

    def _included(self, name: str) -> list[Body]:
        world = read_sdf(find_file(name, self.path), self.search_path)
        self.warnings += world.warnings
        for body in world.bodies.values():
            body.parts = self._dressed(body.parts, [None] * len(body.parts))
        return list(world.bodies.values())

    def _parts(self, name: str, settings: BodySettings) -> list[Part]:
        if settings.mesh is not None:
            parts, warnings = self._mesh(("bodies", name, "mesh"), settings)
            self.warnings += [f"body '{name}': {line}" for line in warnings]
            return parts
        if settings.sdf is not None:
            try:
                world = read_sdf(find_file(settings.sdf, self.path), self.search_path)
            except SettingsError as error:
                raise self.document.error(("bodies", name, "sdf"), str(error)) from None
            self.warnings += world.warnings
            models = world.bodies.values()
            return [replace(part, X_BM=model.X_WB @ part.X_BM) for model in models for part in model.parts]
        return [Part(self._shape(name, settings), Material("default"), pose.from_rpy((0, 0, 0), (0, 0, 0)), name)]

    def _mesh(self, key: tuple[str, ...], settings: BodySettings) -> tuple[list[Part], list[str]]:
        assert settings.mesh is not None  # for the type checker; the caller asked
        options = MeshOptions(settings.scale, settings.unit, settings.up)
        try:
            return read_mesh_file(find_file(settings.mesh, self.path), options)
        except SettingsError as error:
            raise self.document.error(key, str(error)) from None

    def _shape(self, name: str, settings: BodySettings) -> Mesh:
        if settings.terrain is not None:
            try:
                return terrain(read_heights(find_file(settings.terrain.heights, self.path)), settings.terrain.size)
            except ValueError as error:
                raise self.document.error(("bodies", name, "terrain", "heights"), str(error)) from None
        if settings.box is not None:
            return shapes.box(settings.box.size)
        if settings.sphere is not None:
            return shapes.sphere(settings.sphere.radius)
        if settings.cylinder is not None:
            return shapes.cylinder(settings.cylinder.radius, settings.cylinder.length)
        if settings.capsule is not None:
            return shapes.capsule(settings.capsule.radius, settings.capsule.length)
        if settings.ellipsoid is not None:
            return shapes.ellipsoid(settings.ellipsoid.radii)
        assert settings.plane is not None  # the model allows exactly one shape
        return shapes.plane(settings.plane.size, settings.plane.normal)


def _over(new: Material, old: Material) -> Material:
    """The new material with the old one's pictures where it has none: a reflectance must not wipe a file's relief."""
    normal_map = old.normal_map if new.normal_map is None else new.normal_map
    reflectance_map = old.reflectance_map if new.reflectance_map is None else new.reflectance_map
    return Material(new.name, new.reflectance, normal_map, reflectance_map)


def to_pose(settings: PoseSettings) -> pose.Pose:
    """X_WB of what stands in the file."""
    if settings.quaternion is not None:
        return pose.from_quaternion(settings.position, settings.quaternion)
    return pose.from_rpy(settings.position, settings.rpy or (0.0, 0.0, 0.0))


def _listed(names: set[str]) -> str:
    return ", ".join(f'"{name}"' for name in sorted(names))
