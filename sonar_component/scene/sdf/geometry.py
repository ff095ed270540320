"""<geometry> to parts: SDF's shapes, height maps and meshes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from sonar_component.scene import shapes
from sonar_component.scene.body import Part
from sonar_component.scene.material import Material
from sonar_component.scene.mesh import Mesh
from sonar_component.scene.mesh_file import MeshOptions, read_mesh_file
from sonar_component.scene.polygon import extruded
from sonar_component.scene.sdf.numbers import numbers, positive, required, truth
from sonar_component.scene.sdf.uri import SearchPath
from sonar_component.scene.sdf.xml import Element
from sonar_component.scene.terrain import read_heights, terrain
from sonar_component.settings import SettingsError

_PLAIN = Material("default")


@dataclass
class Geometries:
    """Reads geometries of one world; the same shape or file gives the same Mesh.

    Attributes
    ----------
    search : where files may be.
    warn : takes an element and a line about it.
    """

    search: SearchPath
    warn: Callable[[Element, str], None]
    files: dict[tuple[Path, tuple[float, ...]], list[Part]] = field(default_factory=dict)
    made: dict[str, Mesh] = field(default_factory=dict)

    def read(self, geometry: Element) -> list[Part]:
        """Return the parts of a <geometry>, in its frame.

        Raises
        ------
        SettingsError
            With file and line, when the shape is wrong or its file is missing or broken.
        """
        shape = next(iter(geometry.children), None)
        if shape is None or shape.tag == "empty":
            return []
        if shape.tag == "mesh":
            return self._mesh(shape)
        if shape.tag == "heightmap":
            return self._heightmap(shape)
        if shape.tag == "polyline":
            return [Part(self._polylines(list(geometry.all("polyline"))), _PLAIN, np.eye(4))]
        if shape.tag not in _SHAPES:
            raise shape.error(f"is not a shape known here; allowed: {', '.join([*_SHAPES, *_FILES])}")
        return [Part(self._once(shape, _SHAPES[shape.tag]), _PLAIN, np.eye(4))]

    def _once(self, shape: Element, make: Callable[[Element], Mesh]) -> Mesh:
        key = shape.tag + "".join(f"|{child.tag}|{child.text}" for child in shape.children)
        if key not in self.made:
            self.made[key] = make(shape)
        return self.made[key]

    def _polylines(self, shapes: list[Element]) -> Mesh:
        """Outlines in the XY plane, drawn up to the height of the first; one inside another is a hole."""
        outlines = [np.array([numbers(p, (2,), "x y") for p in shape.all("point")]).reshape(-1, 2) for shape in shapes]
        height = positive(required(shapes[0], "height"), 1, "a height")[0]
        try:
            return extruded(outlines, height)
        except ValueError as error:
            raise shapes[0].error(str(error)) from None

    def _file(self, shape: Element) -> tuple[Element, Path]:
        uri = required(shape, "uri")
        try:
            return uri, self.search.find(uri.text, uri.file)
        except ValueError as error:
            raise uri.error(str(error)) from None

    def _mesh(self, shape: Element) -> list[Part]:
        uri, path = self._file(shape)
        at = shape.first("scale")
        scale = numbers(at, (3,), "three factors") if at is not None else [1.0, 1.0, 1.0]
        if 0.0 in scale:
            raise shape.error(f"scale must not be 0, got {scale}")
        key = (path, tuple(scale))
        if key not in self.files:
            try:
                self.files[key], warnings = read_mesh_file(path, MeshOptions((scale[0], scale[1], scale[2])))
            except SettingsError as error:
                raise uri.error(str(error)) from None
            for line in warnings:
                self.warn(uri, line)
        submesh = shape.first("submesh")
        return self.files[key] if submesh is None else _submesh(submesh, self.files[key])

    def _heightmap(self, shape: Element) -> list[Part]:
        uri, path = self._file(shape)
        at, pos = shape.first("size"), shape.first("pos")
        size = positive(at, 3, "three lengths") if at is not None else [1.0, 1.0, 1.0]
        X = np.eye(4)
        X[:3, 3] = numbers(pos, (3,), "a position") if pos is not None else 0.0
        key = f"heightmap|{path}|{size}"
        try:
            if key not in self.made:
                heights = read_heights(path)
                # Gazebo gives the whole height to the brightest pixel of the picture, not to white.
                heights = heights / (np.abs(heights).max() or 1.0)
                self.made[key] = terrain(heights, (size[0], size[1], size[2]))
        except ValueError as error:
            raise uri.error(str(error)) from None
        return [Part(self.made[key], _PLAIN, X)]


def _submesh(submesh: Element, parts: list[Part]) -> list[Part]:
    name = required(submesh, "name")
    chosen = [part for part in parts if part.name == name.text]
    if not chosen:
        names = ", ".join(sorted({part.name for part in parts}))
        raise name.error(f"the mesh has no object {name.text!r}; objects: {names}")
    if not truth(submesh.first("center")):
        return chosen
    points = np.concatenate([p.mesh.vertices @ p.X_BM[:3, :3].T + p.X_BM[:3, 3] for p in chosen])
    shift = np.eye(4)
    shift[:3, 3] = -(points.min(axis=0) + points.max(axis=0)) / 2
    return [replace(part, X_BM=shift @ part.X_BM) for part in chosen]


def _box(shape: Element) -> Mesh:
    x, y, z = positive(required(shape, "size"), 3, "three lengths")
    return shapes.box((x, y, z))


def _radius(shape: Element) -> float:
    return positive(required(shape, "radius"), 1, "a radius")[0]


def _length(shape: Element) -> float:
    return positive(required(shape, "length"), 1, "a length")[0]


def _ellipsoid(shape: Element) -> Mesh:
    x, y, z = positive(required(shape, "radii"), 3, "three radii")
    return shapes.ellipsoid((x, y, z))


def _plane(shape: Element) -> Mesh:
    size, normal = shape.first("size"), shape.first("normal")
    width, depth = positive(size, 2, "two lengths") if size is not None else (1.0, 1.0)
    x, y, z = numbers(normal, (3,), "a direction") if normal is not None else (0.0, 0.0, 1.0)
    if normal is not None and not any((x, y, z)):
        raise normal.error("must have a direction, got 0 0 0")
    return shapes.plane((width, depth), (x, y, z))


_SHAPES: dict[str, Callable[[Element], Mesh]] = {
    "box": _box,
    "sphere": lambda shape: shapes.sphere(_radius(shape)),
    "cylinder": lambda shape: shapes.cylinder(_radius(shape), _length(shape)),
    "capsule": lambda shape: shapes.capsule(_radius(shape), _length(shape)),
    "ellipsoid": _ellipsoid,
    "plane": _plane,
}
_FILES = ("mesh", "heightmap", "polyline", "empty")
