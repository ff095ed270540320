"""Materials and texture coordinates out of what trimesh has read."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from sonar_component.scene.material import Material
from sonar_component.settings import SettingsError

MAX_PIXELS = (
    8192 * 8192
)  # [-], what OpenGL 4.3 must offer is 16384 a side; this bounds a picture that explodes in memory
UNREADABLE = (UnidentifiedImageError, OSError, SyntaxError, Image.DecompressionBombError)
_OBJ_NORMAL_MAPS = ("norm", "map_kn")  # keys of normal maps in an MTL file; map_bump holds heights


def read_image(path: Path, mode: str) -> NDArray[np.uint8]:
    """Read a picture as (h, w, 3) for mode "RGB" or (h, w) for mode "L", uint8, first row on top.

    Raises
    ------
    SettingsError
        When it is missing, not a picture, or larger than MAX_PIXELS.
    """
    try:
        with opened(path) as image:
            return np.array(image.convert(mode))
    except UNREADABLE as error:
        raise SettingsError(f"is not a readable picture: {error}", str(path)) from None


@contextmanager
def opened(path: Path) -> Iterator[Image.Image]:
    """Open a picture of at most MAX_PIXELS; what Pillow raises is in UNREADABLE."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # ours comes next, and stops
        image = Image.open(path)
    with image:
        if image.width * image.height > MAX_PIXELS:
            size = f"{image.width} x {image.height}"
            raise SettingsError(f"is too large a picture: at most {MAX_PIXELS} pixels, got {size}", str(path))
        yield image


def map_of(geometry: Any) -> NDArray[np.float64] | None:
    """Texture coordinates (n, 2) of a trimesh geometry, (0, 0) at the lower left, or None."""
    uv = getattr(geometry.visual, "uv", None)
    if uv is None or len(uv) != len(geometry.vertices):
        return None
    return np.asarray(uv, np.float64)


def material_of(
    geometry: Any, path: Path, known: dict[int, Material], scales: Mapping[str, float], notes: list[str]
) -> Material:
    """Material of a trimesh geometry; the same trimesh material gives the same Material.

    `scales` says by material how steep its normal map is, where that is not 1 [-].
    """
    source = getattr(geometry.visual, "material", None)
    if source is None:
        return known.setdefault(0, Material("default"))
    if id(source) not in known:
        name = str(getattr(source, "name", None) or "default")
        normal_map = _normal_map(source, path, name, notes)
        if normal_map is not None and name in scales:
            normal_map = steeper(normal_map, scales[name])
        known[id(source)] = Material(name, 1.0, normal_map)
    return known[id(source)]


def steeper(normal_map: NDArray[np.uint8], scale: float) -> NDArray[np.uint8]:
    """A normal map (h, w, 3) with the tangents of its slopes times `scale`, as glTF 2.0 has it in section 3.9.3."""
    normals = (normal_map.astype(np.float32) - 128) / 127 * np.array([scale, scale, 1], np.float32)
    normals /= np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-6)
    return np.asarray(np.rint(normals * 127 + 128), np.uint8)


def _normal_map(source: Any, path: Path, name: str, notes: list[str]) -> NDArray[np.uint8] | None:
    picture = getattr(source, "normalTexture", None)
    if picture is not None:
        if picture.width * picture.height > MAX_PIXELS:
            notes.append(f"material '{name}': normal map larger than {MAX_PIXELS} pixels, left out")
            return None
        return np.array(picture.convert("RGB"))
    keys = getattr(source, "kwargs", None) or {}
    for key in _OBJ_NORMAL_MAPS:
        if key in keys:
            try:
                return read_image(path.parent / keys[key][-1], "RGB")
            except SettingsError as error:
                notes.append(f"material '{name}': normal map {error}")
    if "map_bump" in keys or "bump" in keys:
        notes.append(f"material '{name}': a bump map holds heights and is not read; give a normal map as `norm`")
    return None
