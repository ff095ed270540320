"""A world as one sonar draws it: where its parts are, and one list of draws for all views of a fan."""

from __future__ import annotations

from typing import Any

import moderngl
import numba
import numpy as np
from numpy.typing import NDArray

from sonar_component.render.draws import Draws, fill
from sonar_component.render.loaded import Loaded, give_back, load
from sonar_component.render.packing import COMMAND, Packed, pack, with_band
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
        self._rows = self._packed.instances  # of the draws, as they go to the GPU
        self._reflectance_max = 1.0
        self._wide = False
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
        columns = self._packed.instances.dtype
        return with_band(columns) if self._wide else columns

    @property
    def reflectance_max(self) -> float:
        """Greatest reflectance of any part."""
        return self._reflectance_max

    @property
    def packed(self) -> Packed:
        """Tiles of the world."""
        return self._packed

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
            self._choose_columns(self._wide)
        self._world, self._version = world, world.geometry_version

    def place(self, X_WS: Array) -> Array:
        """Poses of all parts in the frame of a sonar at X_WS (4, 4) [m], as (parts, 4, 4) float64."""
        assert self._world is not None
        p = self._packed
        X_WB = np.array([body.X_WB for body in self._world.bodies.values()]).reshape(-1, 4, 4)
        return np.asarray(_relative(X_WS, X_WB, p.part_body, p.X_BM))

    def send(self, draws: Draws, X_SM: Array, X_DS: Array, bands: NDArray[np.float32] | None = None) -> moderngl.Buffer:
        """Send draws to the GPU; returns their indirect commands.

        Parameters
        ----------
        X_SM : (parts, 4, 4) float64
            As ``place`` gives it [m].
        X_DS : (views, 4, 4) float64
            Sonar frame to clip space of each view.
        bands : (views, 2) float32, optional
            First column and number of columns of each view, where they share a target.
        """
        if self._wide != (bands is not None):
            self._choose_columns(bands is not None)
        count = len(draws.tiles)
        if self._commands is None or self._commands.size < count * COMMAND.itemsize:
            self._reserve(_SPARE * max(count, len(self._packed.commands)))
        assert self._commands is not None
        assert self.instances is not None
        if bands is None:
            bands = np.zeros((len(X_DS), 0), np.float32)
        commands = fill(self._packed, draws, X_SM, X_DS, bands, self._rows)
        self.instances.write(self._rows[:count])
        self._commands.write(commands)
        return self._commands

    def _choose_columns(self, wide: bool) -> None:
        self._wide = wide
        if self.loaded is not None:
            self._reserve(_SPARE * len(self._packed.commands))

    def _reserve(self, draws: int) -> None:
        for buffer in (self._commands, self.instances):
            if buffer is not None:
                buffer.release()
        self._rows = np.zeros(draws, self.columns)
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


@numba.njit(nogil=True, cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _relative(X_WS: Any, X_WB: Any, part_body: Any, X_BM: Any) -> Any:
    """Poses of parts in the sonar's frame, (parts, 4, 4) float64.

    The difference of the two positions is rounded to 2^-20 m, a micrometre. Far from the origin (UTM coordinates)
    float64 itself is only good to a nanometre; rounding away that residue gives the same bits there as at the origin.
    """
    X_SM = np.zeros((len(part_body), 4, 4))
    R_WM, away = np.empty((3, 3)), np.empty(3)
    for part in range(len(part_body)):
        body = X_WB[part_body[part]]
        local = X_BM[part]
        for i in range(3):
            for j in range(3):
                R_WM[i, j] = body[i, 0] * local[0, j] + body[i, 1] * local[1, j] + body[i, 2] * local[2, j]
            place = body[i, 0] * local[0, 3] + body[i, 1] * local[1, 3] + body[i, 2] * local[2, 3] + body[i, 3]
            away[i] = np.round((place - X_WS[i, 3]) * _GRID) / _GRID
        for i in range(3):
            for j in range(3):
                X_SM[part, i, j] = X_WS[0, i] * R_WM[0, j] + X_WS[1, i] * R_WM[1, j] + X_WS[2, i] * R_WM[2, j]
            X_SM[part, i, 3] = X_WS[0, i] * away[0] + X_WS[1, i] * away[1] + X_WS[2, i] * away[2]
        X_SM[part, 3, 3] = 1.0
    return X_SM
