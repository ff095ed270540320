"""The world on the GPU: every mesh once in one vertex and one index buffer, a matrix for each part."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from sonar_component.render import tiles
from sonar_component.scene.mesh import Mesh
from sonar_component.scene.world import World

Array = NDArray[np.float64]

_INSTANCE = np.dtype(
    [("X_SM", np.float32, (3, 4)), ("reflectance", np.float32), ("id", np.uint32), ("texture_layer", np.uint32)]
)
_GRID = 2.0**20  # [1/m]: see _relative


@dataclass(frozen=True)
class _Tile:
    part: int
    first_index: int
    index_count: int
    base_vertex: int
    centre: Array
    radius: float


class Geometry:
    """Buffers of a world, refreshed when it changes.

    Attributes
    ----------
    body_names : list of str
        Body of id k + 1 in truth images.
    reflectance_max : float
        Greatest reflectance of any part.
    warnings : list of str
        What was left out, by name.
    """

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._world: World | None = None
        self._version = -1
        self.body_names: list[str] = []
        self.reflectance_max = 1.0
        self.has_normal_maps = False
        self.vertices: moderngl.Buffer | None = None
        self.indices: moderngl.Buffer | None = None
        self.instances: moderngl.Buffer | None = None
        self.normal_maps: moderngl.TextureArray | None = None

    @property
    def empty(self) -> bool:
        """Whether there is nothing to draw."""
        return self._tile_part.size == 0

    def update(self, world: World) -> bool:
        """Load the world again if its geometry changed; True if the buffers are new."""
        if world is self._world and world.geometry_version == self._version:
            return False
        self._world, self._version = world, world.geometry_version
        self._load(world)
        return True

    def place(self, X_WS: Array) -> Array:
        """Bring all parts into the sonar's frame and send their matrices.

        Parameters
        ----------
        X_WS : (4, 4) float64
            Pose of the sonar in the world [m].

        Returns
        -------
        (tiles, 3) float64
            Centres of the tiles in the sonar's frame [m].
        """
        assert self._world is not None
        bodies = list(self._world.bodies.values())
        X_WB = np.array([body.X_WB for body in bodies]).reshape(-1, 4, 4)[self._part_body]
        X_SM = (_relative(X_WS, X_WB) @ self._X_BM)[self._tile_part]
        self._instances["X_SM"] = X_SM[:, :3, :]
        assert self.instances is not None
        self.instances.write(self._instances)
        return np.asarray((X_SM[:, :3, :3] @ self._tile_centre[:, :, None])[:, :, 0] + X_SM[:, :3, 3])

    def commands(self, visible: NDArray[np.intp]) -> NDArray[np.uint32]:
        """(n, 5) uint32: indirect draw commands of the tiles with these indices."""
        return self._commands[visible]

    @property
    def tile_radius(self) -> Array:
        """(tiles,) float64: radii of the tiles' spheres [m]."""
        return self._tile_radius

    def _load(self, world: World) -> None:
        self.release()
        place: dict[int, int] = {}
        meshes: list[Mesh] = []
        parts: list[tuple[Array, float, int, int]] = []
        part_body, X_BM, tile_list = [], [], []
        split: dict[int, list[tuple[int, int, Array, float]]] = {}
        first_index = base_vertex = 0
        index_chunks: list[NDArray[np.int32]] = []
        bases: dict[int, int] = {}
        maps: dict[int, int] = {}
        map_images: list[NDArray[np.uint8]] = []
        for body_index, body in enumerate(world.bodies.values()):
            for part in body.parts:
                key = id(part.mesh)
                if key not in place:
                    place[key] = len(meshes)
                    meshes.append(part.mesh)
                    bases[key] = base_vertex
                    base_vertex += len(part.mesh.vertices)
                    split[key] = []
                    for chosen in tiles.split(part.mesh.vertices, part.mesh.faces):
                        faces = part.mesh.faces[chosen]
                        index_chunks.append(faces.ravel())
                        centre, radius = tiles.bounding_sphere(part.mesh.vertices[faces.ravel()])
                        split[key].append((first_index, faces.size, centre, radius))
                        first_index += faces.size
                layer = 0
                image = part.material.normal_map
                if image is not None and part.mesh.uv is not None:
                    if id(image) not in maps:
                        map_images.append(image)
                        maps[id(image)] = len(map_images)
                    layer = maps[id(image)]
                for first, count, centre, radius in split[key]:
                    tile_list.append(_Tile(len(parts), first, count, bases[key], centre, radius))
                parts.append((np.zeros((3, 4)), part.material.reflectance, body_index + 1, layer))
                part_body.append(body_index)
                X_BM.append(part.X_BM)
        self.body_names = list(world.bodies)
        self.reflectance_max = max((float(p[1]) for p in parts), default=1.0)
        self._part_body = np.array(part_body, np.intp)
        self._X_BM = np.array(X_BM, np.float64).reshape(-1, 4, 4)
        self._tile_part = np.array([t.part for t in tile_list], np.intp)
        self._instances = np.array(parts, _INSTANCE)[self._tile_part]
        self._tile_centre = np.array([t.centre for t in tile_list], np.float64).reshape(-1, 3)
        self._tile_radius = np.array([t.radius for t in tile_list], np.float64)
        self._commands = np.array(
            [(t.index_count, 1, t.first_index, t.base_vertex, k) for k, t in enumerate(tile_list)], np.uint32
        ).reshape(-1, 5)
        self.has_normal_maps = bool(map_images)
        if tile_list:
            self._upload(meshes, index_chunks, map_images)

    def _upload(self, meshes: list[Mesh], index_chunks: list[NDArray[np.int32]], maps: list[NDArray[np.uint8]]) -> None:
        columns = [np.concatenate([m.vertices.astype(np.float32) for m in meshes])]
        columns.append(np.concatenate([m.normals.astype(np.float32) for m in meshes]))
        if maps:
            none = [np.zeros((len(m.vertices), 2), np.float32) if m.uv is None else m.uv for m in meshes]
            columns.append(np.concatenate(none).astype(np.float32))
        self.vertices = self._context.buffer(np.ascontiguousarray(np.hstack(columns)).tobytes())
        self.indices = self._context.buffer(np.concatenate(index_chunks).astype(np.uint32).tobytes())
        self.instances = self._context.buffer(reserve=self._instances.nbytes, dynamic=True)
        if maps:
            self.normal_maps = _texture_array(self._context, maps)

    def release(self) -> None:
        """Give the GPU memory back."""
        for thing in (self.vertices, self.indices, self.instances, self.normal_maps):
            if thing is not None:
                thing.release()
        self.vertices = self.indices = self.instances = self.normal_maps = None


def _relative(X_WS: Array, X_WB: Array) -> Array:
    """Poses of bodies in the sonar's frame, (n, 4, 4) float64.

    The difference of the two positions is rounded to 2^-20 m, a micrometre. Far from the origin (UTM coordinates)
    float64 itself is only good to a nanometre; rounding away that residue gives the same bits there as at the origin.
    """
    X_SB = np.zeros_like(X_WB)
    R_SW = X_WS[:3, :3].T
    X_SB[:, :3, :3] = R_SW @ X_WB[:, :3, :3]
    difference = np.round((X_WB[:, :3, 3] - X_WS[:3, 3]) * _GRID) / _GRID
    X_SB[:, :3, 3] = difference @ R_SW.T
    X_SB[:, 3, 3] = 1.0
    return X_SB


def _texture_array(context: moderngl.Context, maps: list[NDArray[np.uint8]]) -> moderngl.TextureArray:
    """All normal maps at the size of the largest, wrapped, with mipmaps."""
    height, width = (max(image.shape[axis] for image in maps) for axis in (0, 1))
    layers = [_resized(image, height, width)[::-1] for image in maps]  # OpenGL's first row is the lowest
    data = np.ascontiguousarray(np.stack(layers)).tobytes()
    texture = context.texture_array((width, height, len(maps)), 3, data, alignment=1)
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    texture.build_mipmaps()
    return texture


def _resized(image: NDArray[np.uint8], height: int, width: int) -> NDArray[np.uint8]:
    if image.shape[:2] == (height, width):
        return image
    from PIL import Image

    return np.asarray(Image.fromarray(image).resize((width, height), Image.Resampling.BILINEAR))
