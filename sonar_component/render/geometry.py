"""The world on the GPU: its buffers, its poses, and one list of draws for all views of a fan."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from sonar_component.render.packing import COMMAND, INSTANCE, Packed, pack
from sonar_component.scene.world import World

Array = NDArray[np.float64]

_GRID = 2.0**20  # [1/m]: see _relative
_SPARE = 2  # [-], room for draws in the buffers, relative to what is needed when they are made


class Geometry:
    """Buffers of a world, made anew when it changes.

    Attributes
    ----------
    generation : int
        Grows whenever a buffer is another one, so that whoever bound them binds again.
    """

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._world: World | None = None
        self._version = -1
        self._packed = pack(World())
        self._X_SM = np.zeros((0, 4, 4))
        self.generation = 0
        self.vertices: moderngl.Buffer | None = None
        self.indices: moderngl.Buffer | None = None
        self.instances: moderngl.Buffer | None = None
        self.normal_maps: moderngl.TextureArray | None = None
        self._commands: moderngl.Buffer | None = None

    @property
    def empty(self) -> bool:
        """Whether there is nothing to draw."""
        return len(self._packed.commands) == 0

    @property
    def has_normal_maps(self) -> bool:
        """Whether any part has one."""
        return bool(self._packed.normal_maps)

    @property
    def reflectance_max(self) -> float:
        """Greatest reflectance of any part."""
        return float(self._packed.instances["reflectance"].max()) if not self.empty else 1.0

    @property
    def tile_radius(self) -> Array:
        """(tiles,) float64: radii of the tiles' spheres [m]."""
        return self._packed.tile_radius

    def update(self, world: World) -> None:
        """Load the world again if its geometry changed."""
        if world is self._world and world.geometry_version == self._version:
            return
        self.release()
        self._world, self._version, self._packed = world, world.geometry_version, pack(world)
        if not self.empty:
            self._upload(self._packed)

    def place(self, X_WS: Array) -> Array:
        """Bring all parts into the sonar's frame.

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
        p = self._packed
        X_WB = np.array([body.X_WB for body in self._world.bodies.values()]).reshape(-1, 4, 4)
        self._X_SM = _relative(X_WS, X_WB[p.part_body] @ p.X_BM)[p.tile_part]
        R, t = self._X_SM[:, :3, :3], self._X_SM[:, :3, 3]
        return np.asarray((R @ p.tile_centre[:, :, None])[:, :, 0] + t)

    def select(self, seen: NDArray[np.bool_], X_DS: Array, bands: NDArray[np.float32]) -> tuple[moderngl.Buffer, int]:
        """Send the draws of the tiles that each view sees.

        Parameters
        ----------
        seen : (views, tiles) bool
        X_DS : (views, 4, 4) float64
            Sonar frame to clip space of each view.
        bands : (views, 2) float32
            First column and number of columns of each view.

        Returns
        -------
        Buffer of indirect commands, and their number.
        """
        views, chosen = np.nonzero(seen)
        X_SM = self._X_SM[chosen]
        instances = self._packed.instances[chosen]
        instances["X_SM"], instances["X_DM"] = X_SM[:, :3], X_DS[views] @ X_SM
        instances["band"] = bands[views]
        commands = self._packed.commands[chosen]
        commands["base_instance"] = np.arange(len(chosen))
        if self._commands is None or self._commands.size < commands.nbytes:
            self._reserve(_SPARE * max(len(chosen), len(self._packed.commands)))
        assert self._commands is not None
        assert self.instances is not None
        self.instances.write(instances)
        self._commands.write(commands)
        return self._commands, len(chosen)

    def _reserve(self, draws: int) -> None:
        for buffer in (self._commands, self.instances):
            if buffer is not None:
                buffer.release()
        self._commands = self._context.buffer(reserve=draws * COMMAND.itemsize, dynamic=True)
        self.instances = self._context.buffer(reserve=draws * INSTANCE.itemsize, dynamic=True)
        self.generation += 1

    def _upload(self, packed: Packed) -> None:
        self.vertices = self._context.buffer(packed.vertices)
        self.indices = self._context.buffer(packed.indices)
        self._reserve(_SPARE * len(packed.commands))
        if packed.normal_maps:
            self.normal_maps = _texture_array(self._context, packed.normal_maps)

    def release(self) -> None:
        """Give the GPU memory back."""
        for thing in (self.vertices, self.indices, self.instances, self._commands, self.normal_maps):
            if thing is not None:
                thing.release()
        self.vertices = self.indices = self.instances = self._commands = self.normal_maps = None


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
