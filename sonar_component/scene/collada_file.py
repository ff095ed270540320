"""COLLADA through pycollada: objects by the names of their nodes, materials by name, unit and up axis.

trimesh reads COLLADA too, but drops the names of nodes and materials, the unit and the up axis: with it, neither an SDF
<submesh> nor a reflectance by material name finds what it means.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import collada
import numpy as np
from numpy.typing import NDArray

from sonar_component.scene.file_object import FileObject
from sonar_component.scene.material import Material
from sonar_component.scene.surface import Surface
from sonar_component.scene.texture import read_image
from sonar_component.settings import SettingsError

_UP = {"X_UP": "x", "Y_UP": "y", "Z_UP": "z"}
_IGNORED = [collada.common.DaeUnsupportedError, collada.common.DaeBrokenRefError, collada.common.DaeIncompleteError]


def collada_objects(path: Path, warnings: list[str]) -> tuple[list[FileObject], float, str]:
    """Read all objects of a file.

    Returns
    -------
    objects : in the file's own unit and axes.
    unit : metres per number.
    up : "x", "y" or "z"; Y where the file says nothing, by the standard.

    Raises
    ------
    ValueError
        When the file declares a document type (it may hold an entity bomb), or its unit is not a length; besides,
        whatever pycollada stumbles over in a broken file.
    """
    data = path.read_bytes()
    start = data.find(b"<COLLADA")
    if start < 0:
        raise ValueError("it does not begin like COLLADA")
    if b"<!DOCTYPE" in data[:start] or b"<!ENTITY" in data[:start]:
        raise ValueError("it declares a document type, which is not read because it can hold an entity bomb")
    document = collada.Collada(io.BytesIO(data), ignore=_IGNORED)
    unit = document.assetInfo.unitmeter
    unit = 1.0 if unit is None else float(unit)
    if not (np.isfinite(unit) and unit > 0):
        raise ValueError(f"its unit must be a number of metres greater than 0, got {unit}")
    reader = _Reader(path, warnings)
    for node in document.scene.nodes if document.scene is not None else ():
        reader.walk(node, np.eye(4), "")
    return reader.objects, unit, _UP.get(document.assetInfo.upaxis, "y")


class _Reader:
    def __init__(self, path: Path, warnings: list[str]) -> None:
        self.path, self.warnings = path, warnings
        self.objects: list[FileObject] = []
        self.surfaces: dict[int, Surface] = {}
        self.materials: dict[str, Material] = {}

    def walk(self, node: Any, X_FN: NDArray[np.float64], name: str) -> None:
        """Collect the geometries below a node."""
        if isinstance(node, collada.scene.GeometryNode):
            self._geometry(node, X_FN, name)
        elif isinstance(node, collada.scene.ControllerNode):
            self.warnings.append(f"'{name}': is moved by a skeleton, left out")
        children = getattr(node, "children", None)
        for child in children if children is not None else ():
            X = X_FN @ np.asarray(node.matrix, np.float64) if isinstance(node, collada.scene.Node) else X_FN
            own = node.xmlnode.get("name") or getattr(node, "id", None)
            self.walk(child, X, own or name)

    def _geometry(self, node: Any, X_FN: NDArray[np.float64], name: str) -> None:
        bound = {link.symbol: link.target for link in node.materials}
        name = name or node.geometry.name or node.geometry.id
        for primitive in node.geometry.primitives:
            triangles = primitive if isinstance(primitive, collada.triangleset.TriangleSet) else None
            if isinstance(primitive, collada.polylist.Polylist):
                triangles = primitive.triangleset()
            if triangles is None or triangles.vertex is None or len(triangles.vertex_index) == 0:
                self.warnings.append(f"'{name}': holds no faces (points or lines only), left out")
                continue
            if id(primitive) not in self.surfaces:
                self.surfaces[id(primitive)] = _surface(name, triangles)
            material = self._material(bound.get(primitive.material), primitive.material)
            self.objects.append(FileObject(name, X_FN, self.surfaces[id(primitive)], material))

    def _material(self, source: Any, symbol: str | None) -> Material:
        name = str((source.name or source.id) if source is not None else symbol or "default")
        if name not in self.materials:
            self.materials[name] = Material(name, 1.0, self._normal_map(source, name))
        return self.materials[name]

    def _normal_map(self, source: Any, name: str) -> NDArray[np.uint8] | None:
        bump = getattr(getattr(source, "effect", None), "bumpmap", None)
        try:
            reference = bump.sampler.surface.image.path if bump is not None else None
            return None if reference is None else read_image(self.path.parent / reference, "RGB")
        except (AttributeError, SettingsError) as error:
            self.warnings.append(f"material '{name}': normal map {error}")
            return None


def _surface(name: str, triangles: Any) -> Surface:
    """Make vertices from the distinct combinations of position, normal and texture coordinate."""
    indices = [triangles.vertex_index]
    if triangles.normal is not None and triangles.normal_index is not None:
        indices.append(triangles.normal_index)
    has_normals = len(indices) == 2
    has_uv = len(triangles.texcoordset) > 0
    if has_uv:
        indices.append(triangles.texcoord_indexset[0])
    rows = np.stack([np.asarray(index, np.int64).reshape(-1) for index in indices], 1)
    key = rows[:, 0]
    for column in rows.T[1:]:
        key = key * (int(column.max()) + 1) + column
    _, first, faces = np.unique(key, return_index=True, return_inverse=True)
    corners = rows[first]
    vertices = np.asarray(triangles.vertex, np.float64)[corners[:, 0]]
    normals = np.asarray(triangles.normal, np.float64)[corners[:, 1]] if has_normals else None
    uv = np.asarray(triangles.texcoordset[0], np.float64)[corners[:, -1], :2] if has_uv else None
    return Surface(name, vertices, faces.reshape(-1, 3), normals, uv)
