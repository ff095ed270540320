"""A world as flat arrays, ready for the GPU: every mesh once, cut into tiles; a row for each tile of each part."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sonar_component.render import closed, tiles
from sonar_component.scene.body import Part
from sonar_component.scene.mesh import Mesh
from sonar_component.scene.world import World

Array = NDArray[np.float64]

_ALWAYS = (
    ("X_SM", np.float32, (3, 4)),  # pose of the part in the sonar's frame [m]
    ("X_DM", np.float32, (4, 4)),  # the part's frame to the clip space of one view
    ("reflectance", np.float32),
    ("id", np.uint32),  # of its body, from 1
)
_BAND = ("band", np.float32, (2,))  # first column and number of columns of the view, where there are several
_NORMAL_LAYER = ("normal_layer", np.uint32)  # of its normal map, from 1; 0 is none
_REFLECTANCE_LAYER = ("reflectance_layer", np.uint32)  # the same of its reflectance map
COMMAND = np.dtype(
    [(name, np.uint32) for name in ("count", "instances", "first_index", "base_vertex", "base_instance")]
)


@dataclass(frozen=True)
class Packed:
    """Arrays of a world.

    Attributes
    ----------
    vertices : (n, 6 or 8) float32
        Position [m] and normal in the part's frame M; texture coordinates if any part has a picture.
    indices : (m,) uint32
        Corners of triangles, tile by tile, counted from the first vertex of their mesh.
    normal_maps : list of (h, w, 3) uint8
    reflectance_maps : list of (h, w) uint8
    part_body : (parts,) int
        Index of each part's body.
    X_BM : (parts, 4, 4) float64 [m]
    tile_part : (tiles,) int
        Index of each tile's part.
    tile_centre, tile_radius : (tiles, 3), (tiles,) float64
        Bounding spheres in M [m].
    tile_hull : (tiles, 2, 3) float64
        Least and greatest corner in M of the closed shells that a tile's faces belong to [m]; NaN where they are open.
    tile_axis, tile_spread : (tiles, 3), (tiles,) float64
        Mean direction in M of the faces' outward normals, and the greatest angle from it [rad].
    pictured : (tiles,) bool
        Which belong to a part with a normal map or a reflectance map.
    instances : (tiles,) of ``instance_type``, without poses
    commands : (tiles,) COMMAND, without base_instance
    """

    vertices: NDArray[np.float32]
    indices: NDArray[np.uint32]
    normal_maps: list[NDArray[np.uint8]]
    reflectance_maps: list[NDArray[np.uint8]]
    part_body: NDArray[np.intp]
    X_BM: Array
    tile_part: NDArray[np.intp]
    tile_centre: Array
    tile_radius: Array
    tile_hull: Array
    tile_axis: Array
    tile_spread: Array
    pictured: NDArray[np.bool_]
    instances: NDArray[np.void]
    commands: NDArray[np.void]

    @property
    def has_normal_maps(self) -> bool:
        """Whether any part has one."""
        return "normal_layer" in (self.instances.dtype.names or ())

    @property
    def has_reflectance_maps(self) -> bool:
        """Whether any part has one."""
        return "reflectance_layer" in (self.instances.dtype.names or ())

    def without_bulk(self) -> Packed:
        """What a renderer still needs once vertices, corners and pictures are in its own memory."""
        vertices, indices = self.vertices[:0].copy(), self.indices[:0].copy()
        return replace(self, vertices=vertices, indices=indices, normal_maps=[], reflectance_maps=[])


@dataclass(frozen=True)
class _MeshTiles:
    base_vertex: int
    commands: NDArray[np.void]
    centres: Array
    radii: Array
    hulls: Array
    axes: Array
    spreads: Array


def pack(world: World) -> Packed:
    """Lay a world out in arrays."""
    parts = [(index, part) for index, body in enumerate(world.bodies.values()) for part in body.parts]
    meshes = list({id(part.mesh): part.mesh for _, part in parts}.values())
    indices: list[NDArray[np.int32]] = []
    of_mesh = _pack_meshes(meshes, indices)
    normal_maps, normal_layers = _layers([(part, part.material.normal_map) for _, part in parts])
    reflectance_maps, reflectance_layers = _layers([(part, part.material.reflectance_map) for _, part in parts])
    columns = instance_type(bool(normal_maps), bool(reflectance_maps))
    instances, commands, tile_part = [], [], []
    for number, (body, part) in enumerate(parts):
        tiled = of_mesh[id(part.mesh)]
        instance = np.zeros(len(tiled.commands), columns)
        instance["reflectance"], instance["id"] = part.material.reflectance, body + 1
        if normal_maps:
            instance["normal_layer"] = normal_layers[number]
        if reflectance_maps:
            instance["reflectance_layer"] = reflectance_layers[number]
        instances.append(instance)
        commands.append(tiled.commands)
        tile_part += [number] * len(tiled.commands)
    tiled_parts = [of_mesh[id(part.mesh)] for _, part in parts]
    pictured = [normal or reflectance for normal, reflectance in zip(normal_layers, reflectance_layers, strict=True)]
    of_tile = np.array(tile_part, np.intp)
    return Packed(
        vertices=_vertices(meshes, bool(normal_maps or reflectance_maps)),
        indices=_joined(indices, np.uint32, ()),
        normal_maps=normal_maps,
        reflectance_maps=reflectance_maps,
        part_body=np.array([body for body, _ in parts], np.intp),
        X_BM=np.array([part.X_BM for _, part in parts], np.float64).reshape(-1, 4, 4),
        tile_part=of_tile,
        tile_centre=_joined([t.centres for t in tiled_parts], np.float64, (3,)),
        tile_radius=_joined([t.radii for t in tiled_parts], np.float64, ()),
        tile_hull=_joined([t.hulls for t in tiled_parts], np.float64, (2, 3)),
        tile_axis=_joined([t.axes for t in tiled_parts], np.float64, (3,)),
        tile_spread=_joined([t.spreads for t in tiled_parts], np.float64, ()),
        pictured=np.array(pictured, np.bool_)[of_tile],
        instances=_joined(instances, columns, ()),
        commands=_joined(commands, COMMAND, ()),
    )


def instance_type(normal_maps: bool = False, reflectance_maps: bool = False) -> np.dtype[np.void]:
    """Columns of an instance: only those that the world needs."""
    return np.dtype([*_ALWAYS, *[_NORMAL_LAYER] * normal_maps, *[_REFLECTANCE_LAYER] * reflectance_maps])


def with_band(columns: np.dtype[np.void]) -> np.dtype[np.void]:
    """The same columns and one for the views of a wide fan."""
    return np.dtype([*columns.descr, _BAND])


def instance_format(columns: np.dtype[np.void], wanted: Collection[str]) -> tuple[str, list[str]]:
    """How moderngl binds instances: its format of the columns, and the attributes of a shader that reads `wanted`.

    A matrix comes as one attribute for each row: ``in_X_SM_0``, ``in_X_SM_1``...
    """
    assert columns.fields is not None
    words, attributes = [], []
    for name, (column, *_) in columns.fields.items():
        rows, width = column.shape if len(column.shape) == 2 else (1, *column.shape, 1)[:2]
        if name not in wanted:
            words.append(f"{column.itemsize}x")
            continue
        kind = "u" if column.base == np.uint32 else "f"
        words += [f"{width}{kind}"] * rows
        attributes += [f"in_{name}"] if rows == 1 else [f"in_{name}_{row}" for row in range(rows)]
    return " ".join(words) + "/i", attributes


def _layers(of_parts: list[tuple[Part, NDArray[np.uint8] | None]]) -> tuple[list[NDArray[np.uint8]], list[int]]:
    """Distinct pictures, and for each part the place of its own, from 1; 0 where it has none."""
    found: dict[int, tuple[int, NDArray[np.uint8]]] = {}
    layers = []
    for part, image in of_parts:
        usable = image is not None and part.mesh.uv is not None
        layers.append(found.setdefault(id(image), (len(found) + 1, image))[0] if usable and image is not None else 0)
    return [image for _, image in found.values()], layers


def _pack_meshes(meshes: list[Mesh], indices: list[NDArray[np.int32]]) -> dict[int, _MeshTiles]:
    """Cut each mesh into tiles and append their corners to `indices`."""
    first_index = base_vertex = 0
    packed = {}
    for mesh in meshes:
        shells = closed.find_shells(mesh.vertices, mesh.faces)
        # A tile is of closed shells or of open surfaces: the ones are drawn from one side, the others from both.
        chosen = [
            group[piece].astype(np.int32)
            for group in (np.flatnonzero(shells.number >= 0), np.flatnonzero(shells.number < 0))
            for piece in tiles.split(mesh.vertices, shells.faces[group])
        ]
        faces = [shells.faces[piece] for piece in chosen]
        spheres = [tiles.bounding_sphere(mesh.vertices[piece.ravel()]) for piece in faces]
        hulls = [shells.hull(piece) if shells.number[piece[0]] >= 0 else np.full((2, 3), np.nan) for piece in chosen]
        cones = [closed.cone(mesh.vertices, piece) for piece in faces]
        commands = np.zeros(len(faces), COMMAND)
        commands["count"], commands["instances"] = [piece.size for piece in faces], 1
        commands["first_index"] = first_index + np.cumsum(commands["count"]) - commands["count"]
        commands["base_vertex"] = base_vertex
        packed[id(mesh)] = _MeshTiles(
            base_vertex,
            commands,
            np.array([centre for centre, _ in spheres]).reshape(-1, 3),
            np.array([radius for _, radius in spheres]),
            np.array(hulls).reshape(-1, 2, 3),
            np.array([axis for axis, _ in cones]).reshape(-1, 3),
            np.array([spread for _, spread in cones]),
        )
        indices += [piece.ravel() for piece in faces]
        first_index += sum(piece.size for piece in faces)
        base_vertex += len(mesh.vertices)
    return packed


def _vertices(meshes: list[Mesh], with_uv: bool) -> NDArray[np.float32]:
    rows = []
    for mesh in meshes:
        columns = [mesh.vertices.astype(np.float32), mesh.normals.astype(np.float32)]
        if with_uv:
            columns.append(np.zeros((len(mesh.vertices), 2), np.float32) if mesh.uv is None else mesh.uv)
        rows.append(np.hstack(columns))
    return _joined(rows, np.float32, (8 if with_uv else 6,))


def _joined(pieces: Sequence[NDArray[Any]], dtype: Any, shape: tuple[int, ...]) -> NDArray[Any]:
    """All pieces as one array of that type, also when there is none."""
    return np.concatenate([np.zeros((0, *shape), dtype), *pieces]).astype(dtype, copy=False)
