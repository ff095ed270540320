"""A world as one sonar draws it: where its parts are, and one list of draws for all views of a fan."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from sonar_component.render.loaded import Loaded, give_back, load
from sonar_component.render.packing import COMMAND, pack, with_bands
from sonar_component.scene.world import World

Array = NDArray[np.float64]

_GRID = 2.0**20  # [1/m]: see _relative
_SPARE = 2  # [-], room for draws in the buffers, relative to what is needed when they are made


class Geometry:
    """A world as one sonar draws it: buffers that it shares with others, and a list of draws of its own.

    Attributes
    ----------
    loaded : Loaded or None
        None where there is nothing to draw.
    generation : int
        Grows whenever a buffer is another one, so that whoever bound them binds again.
    """

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._world: World | None = None
        self._version = -1
        self._packed = pack(World())
        self._instances = self._packed.instances  # with the columns that are drawn with
        self._reflectance_max = 1.0
        self._pictured = self._packed.has_pictures()
        self._wide = False
        self._X_SM = np.zeros((0, 4, 4))
        self.generation = 0
        self.loaded: Loaded | None = None
        self.instances: moderngl.Buffer | None = None
        self._commands: moderngl.Buffer | None = None

    @property
    def empty(self) -> bool:
        """Whether there is nothing to draw."""
        return len(self._packed.commands) == 0

    @property
    def has_normal_maps(self) -> bool:
        """Whether any part has one."""
        return self._packed.has_normal_maps

    @property
    def has_reflectance_maps(self) -> bool:
        """Whether any part has one."""
        return self._packed.has_reflectance_maps

    @property
    def textured(self) -> bool:
        """Whether vertices have texture coordinates."""
        return self.has_normal_maps or self.has_reflectance_maps

    @property
    def columns(self) -> np.dtype[np.void]:
        """Of the instances: see ``packing.instance_format``."""
        return self._instances.dtype

    @property
    def reflectance_max(self) -> float:
        """Greatest reflectance of any part."""
        return self._reflectance_max

    @property
    def tile_radius(self) -> Array:
        """(tiles,) float64: radii of the tiles' spheres [m]."""
        return self._packed.tile_radius

    def update(self, world: World) -> None:
        """Load the world again if its geometry changed."""
        if world is self._world and world.geometry_version == self._version:
            return
        loaded = load(self._context, world)
        if loaded is self.loaded and loaded is not None:
            give_back(self._context, loaded)  # counted twice: only what does not reach the buffers has changed
        else:
            self.release()
            self.loaded = loaded
            self._packed = loaded.packed if loaded is not None else pack(World())
            self._reflectance_max = float(self._packed.instances["reflectance"].max(initial=0.0)) or 1.0
            self._pictured = self._packed.has_pictures()
            self._choose_columns(self._wide)
        self._world, self._version = world, world.geometry_version

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

    def select(
        self, seen: NDArray[np.bool_], X_DS: Array, bands: NDArray[np.float32] | None = None
    ) -> tuple[moderngl.Buffer, int, int]:
        """Send the draws of the tiles that each view sees.

        Parameters
        ----------
        seen : (views, tiles) bool
        X_DS : (views, 4, 4) float64
            Sonar frame to clip space of each view.
        bands : (views, 2) float32, optional
            First column and number of columns of each view, where they share a target.

        Returns
        -------
        Buffer of indirect commands, their number, and how many of them, the first ones, are of parts with pictures.
        """
        if self._wide != (bands is not None):
            self._choose_columns(bands is not None)
        views, chosen = np.nonzero(seen)
        with_pictures = 0
        if self.textured:
            order = np.argsort(~self._pictured[chosen], kind="stable")
            views, chosen = views[order], chosen[order]
            with_pictures = int(np.count_nonzero(self._pictured[chosen]))
        X_SM = self._X_SM[chosen]
        instances = self._instances[chosen]
        instances["X_SM"], instances["X_DM"] = X_SM[:, :3], X_DS[views] @ X_SM
        if bands is not None:
            instances["band"] = bands[views]
        commands = self._packed.commands[chosen]
        commands["base_instance"] = np.arange(len(chosen))
        if self._commands is None or self._commands.size < commands.nbytes:
            self._reserve(_SPARE * max(len(chosen), len(self._packed.commands)))
        assert self._commands is not None
        assert self.instances is not None
        self.instances.write(instances)
        self._commands.write(commands)
        return self._commands, len(chosen), with_pictures

    def _choose_columns(self, wide: bool) -> None:
        self._wide = wide
        self._instances = with_bands(self._packed.instances) if wide else self._packed.instances
        if self.loaded is not None:
            self._reserve(_SPARE * len(self._packed.commands))

    def _reserve(self, draws: int) -> None:
        for buffer in (self._commands, self.instances):
            if buffer is not None:
                buffer.release()
        self._commands = self._context.buffer(reserve=draws * COMMAND.itemsize, dynamic=True)
        self.instances = self._context.buffer(reserve=draws * self.columns.itemsize, dynamic=True)
        self.generation += 1

    def release(self) -> None:
        """Give the GPU memory back."""
        if self.loaded is not None:
            give_back(self._context, self.loaded)
        for thing in (self.instances, self._commands):
            if thing is not None:
                thing.release()
        self.loaded = self.instances = self._commands = self._world = None


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
