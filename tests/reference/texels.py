"""The two words of a sample, packed and unpacked as the header of render/shaders/footprint.frag states them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

MOST = 1.9  # [-], greatest extent relative to its range


@dataclass(frozen=True)
class Sample:
    """Range [m] (0 on a miss), extent in range [m], echo strength [-], whether the range falls with elevation."""

    range: float
    extent: float
    strength: float
    falling: bool


def pack(ranges: Any, extents: Any, strengths: Any, falling: Any, strength_max: float) -> np.ndarray:
    """(columns, rows, 2) uint32; all arguments are broadcast to (columns, rows)."""
    ranges, extents, strengths, falling = np.broadcast_arrays(ranges, extents, strengths, falling)
    root_strength = np.rint(np.sqrt(np.clip(strengths / strength_max, 0, 1)) * 65535)
    spans = np.nan_to_num(extents / np.maximum(ranges, 1e-9))
    root_extent = np.rint(np.sqrt(np.clip(spans / MOST, 0, 1)) * 32767)
    code = root_strength.astype(np.uint32) | root_extent.astype(np.uint32) << np.uint32(16)
    code |= np.where(falling, np.uint32(1 << 31), np.uint32(0))
    return np.stack([ranges.astype(np.float32).view(np.uint32), code], axis=-1)


def unpack(words: np.ndarray, strength_max: float) -> Sample:
    code = int(words[1])
    distance = float(words[:1].view(np.float32)[0])
    return Sample(
        range=distance,
        extent=((code >> 16 & 0x7FFF) / 32767) ** 2 * MOST * distance,
        strength=((code & 0xFFFF) / 65535) ** 2 * strength_max,
        falling=bool(code >> 31),
    )
