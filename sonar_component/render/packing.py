"""A world as flat arrays, ready for the GPU: every mesh once, cut into tiles; a row for each tile of each part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sonar_component.render import tiles
from sonar_component.scene.mesh import Mesh
from sonar_component.scene.world import World

Array = NDArray[np.float64]

INSTANCE = np.dtype(
    [
        ("X_SM", np.float32, (3, 4)),  # pose of the part in the sonar's frame [m]
        ("X_DM", np.float32, (4, 4)),  # the part's frame to the clip space of one view
        ("band", np.float32, (2,)),  # first column and number of columns of that view
        ("reflectance", np.float32),
        ("id", np.uint32),  # of its body, from 1
        ("texture_layer", np.uint32),  # of its normal map, from 1; 0 is none
    ]
)
COMMAND = np.dtype(
    [(name, np.uint32) for name in ("count", "instances", "first_index", "base_vertex", "base_instance")]
)


@dataclass(frozen=True)
class Packed:
    """Arrays of a world.

    Attributes
    ----------
    vertices : (n, 6 or 8) float32
        Position [m] and normal in the part's frame M; texture coordinates if any part has a normal map.
    indices : (m,) uint32
        Corners of triangles, tile by tile, counted from the first vertex of their mesh.
    normal_maps : list of (h, w, 3) uint8
    part_body : (parts,) int
        Index of each part's body.
    X_BM : (parts, 4, 4) float64 [m]
    tile_part : (tiles,) int
        Index of each tile's part.
    tile_centre, tile_radius : (tiles, 3), (tiles,) float64
        Bounding spheres in M [m].
    instances : (tiles,) INSTANCE, without poses
    commands : (tiles,) COMMAND, without base_instance
    """

    vertices: NDArray[np.float32]
    indices: NDArray[np.uint32]
    normal_maps: list[NDArray[np.uint8]]
    part_body: NDArray[np.intp]
    X_BM: Array
    tile_part: NDArray[np.intp]
    tile_centre: Array
    tile_radius: Array
    instances: NDArray[np.void]
    commands: NDArray[np.void]


@dataclass(frozen=True)
class _MeshTiles:
    base_vertex: int
    commands: NDArray[np.void]
    centres: Array
    radii: Array


def pack(world: World) -> Packed:
    """Lay a world out in arrays."""
    parts = [(index, part) for index, body in enumerate(world.bodies.values()) for part in body.parts]
    meshes = list({id(part.mesh): part.mesh for _, part in parts}.values())
    indices: list[NDArray[np.int32]] = []
    of_mesh = _pack_meshes(meshes, indices)
    maps: dict[int, tuple[int, NDArray[np.uint8]]] = {}
    instances, commands, tile_part = [], [], []
    for number, (body, part) in enumerate(parts):
        tiled = of_mesh[id(part.mesh)]
        image, layer = part.material.normal_map, 0
        if image is not None and part.mesh.uv is not None:
            layer, _ = maps.setdefault(id(image), (len(maps) + 1, image))
        instance = np.zeros(len(tiled.commands), INSTANCE)
        instance["reflectance"], instance["id"], instance["texture_layer"] = part.material.reflectance, body + 1, layer
        instances.append(instance)
        commands.append(tiled.commands)
        tile_part += [number] * len(tiled.commands)
    spheres = [of_mesh[id(part.mesh)] for _, part in parts]
    return Packed(
        vertices=_vertices(meshes, bool(maps)),
        indices=_joined(indices, np.uint32, ()),
        normal_maps=[image for _, image in maps.values()],
        part_body=np.array([body for body, _ in parts], np.intp),
        X_BM=np.array([part.X_BM for _, part in parts], np.float64).reshape(-1, 4, 4),
        tile_part=np.array(tile_part, np.intp),
        tile_centre=_joined([s.centres for s in spheres], np.float64, (3,)),
        tile_radius=_joined([s.radii for s in spheres], np.float64, ()),
        instances=_joined(instances, INSTANCE, ()),
        commands=_joined(commands, COMMAND, ()),
    )


def _pack_meshes(meshes: list[Mesh], indices: list[NDArray[np.int32]]) -> dict[int, _MeshTiles]:
    """Cut each mesh into tiles and append their corners to `indices`."""
    first_index = base_vertex = 0
    packed = {}
    for mesh in meshes:
        pieces = [mesh.faces[chosen].ravel() for chosen in tiles.split(mesh.vertices, mesh.faces)]
        spheres = [tiles.bounding_sphere(mesh.vertices[piece]) for piece in pieces]
        commands = np.zeros(len(pieces), COMMAND)
        commands["count"], commands["instances"] = [piece.size for piece in pieces], 1
        commands["first_index"] = first_index + np.cumsum(commands["count"]) - commands["count"]
        commands["base_vertex"] = base_vertex
        centres = np.array([centre for centre, _ in spheres]).reshape(-1, 3)
        packed[id(mesh)] = _MeshTiles(base_vertex, commands, centres, np.array([radius for _, radius in spheres]))
        indices += pieces
        first_index += sum(piece.size for piece in pieces)
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
