"""Sea floors from grids of heights: a picture (grey PNG or TIFF, 8, 16 or 32 bit) or an .npy array."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sonar_component.scene.mesh import Mesh
from sonar_component.scene.shapes import grid_faces
from sonar_component.scene.texture import UNREADABLE, opened
from sonar_component.settings import SettingsError

MAX_SAMPLES = 2049 * 2049  # [-], 8 million triangles, which take 2 GB while they are made


def read_heights(path: Path) -> NDArray[np.float64]:
    """Read a grid of heights (rows, columns), first row on top (far Y), in the file's own numbers.

    Integer pictures are scaled to 0..1 by their depth, so that the terrain's size says the height of white.

    Raises
    ------
    SettingsError
        When it is missing, not grey, smaller than 2 x 2, or too large.
    """
    heights = _read_array(path) if path.suffix.lower() == ".npy" else _read_picture(path)
    if heights.ndim != 2 or min(heights.shape) < 2:
        size = " x ".join(str(n) for n in heights.shape[::-1])
        raise SettingsError(f"a grid of heights must be at least 2 x 2, got {size}", str(path))
    if heights.size > MAX_SAMPLES:
        raise SettingsError(f"has too many heights: at most {MAX_SAMPLES}, got {heights.size}", str(path))
    return heights


def terrain(heights: NDArray[np.float64], size: tuple[float, float, float]) -> Mesh:
    """A sea floor of `size` [m] around the origin.

    Parameters
    ----------
    heights : (rows, columns), first row at greatest Y, first column at least X; times size[2] gives Z.
    size : extent along X and Y, and the height of 1 in `heights` [m].

    Raises
    ------
    ValueError
        When a height is not a number.
    """
    if not np.isfinite(heights).all():
        raise ValueError(f"{int((~np.isfinite(heights)).sum())} heights are NaN or infinite")
    rows, columns = heights.shape
    x = np.linspace(-size[0] / 2, size[0] / 2, columns)
    y = np.linspace(-size[1] / 2, size[1] / 2, rows)
    z = heights[::-1] * size[2]
    slope_y, slope_x = np.gradient(z, y, x)
    normals = np.stack([-slope_x, -slope_y, np.ones_like(z)], 2).reshape(-1, 3)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    X, Y = np.meshgrid(x, y)
    U, V = np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows))
    vertices = np.stack([X, Y, z], 2).reshape(-1, 3)
    uv = np.stack([U, V], 2).reshape(-1, 2)
    return Mesh(vertices, normals.astype(np.float32), grid_faces(rows, columns), uv.astype(np.float32))


def _read_array(path: Path) -> NDArray[np.float64]:
    try:
        array = np.load(path, allow_pickle=False)
    except (OSError, ValueError) as error:
        raise SettingsError(f"is not a readable array: {error}", str(path)) from None
    return np.asarray(array, np.float64)


def _read_picture(path: Path) -> NDArray[np.float64]:
    try:
        with opened(path) as image:
            values = np.asarray(image.convert("L") if image.mode in ("RGB", "RGBA", "P", "LA", "1") else image)
    except UNREADABLE as error:
        raise SettingsError(f"is not a readable picture: {error}", str(path)) from None
    if values.dtype == np.uint8:
        return values / 255.0
    if np.issubdtype(values.dtype, np.integer):  # Pillow widens 16 bits to int32 in some modes
        return values / 65535.0
    return values.astype(np.float64)
