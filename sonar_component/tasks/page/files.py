"""What the page's save buttons give: the image as a figure, or as it was measured."""

from __future__ import annotations

import io
import math
from typing import Any

import numpy as np

from sonar_component.pictures.colours import COLOUR_MAPS, Tone
from sonar_component.pictures.figure import Kind, save_png
from sonar_component.samples import Sonar

_MAX_DYNAMIC_RANGE = 120.0  # [dB], what float32 images hold at most


def saved_file(request: dict[str, Any], sonar: Sonar) -> tuple[str, bytes]:
    """The file that a page asked for.

    Parameters
    ----------
    request : dict
        ``what``: "png" or "raw"; for a picture also ``source``, ``view``, ``colour_map``, ``ceiling`` and
        ``dynamic_range`` (0: linear).

    Returns
    -------
    (name, content)

    Raises
    ------
    ValueError
        If the request is not one of these.
    """
    source = "".join(c if c.isalnum() else "_" for c in str(request.get("source", "sonar")))[:80]
    name = f"{source}_{sonar.time}"
    if request.get("what") == "raw":
        return f"{name}.npz", raw_file(sonar)
    if request.get("what") != "png":
        raise ValueError(f"only png and raw can be saved, not {request.get('what')!r}")
    colour_map, view = str(request.get("colour_map", "copper")), request.get("view", "fan")
    if colour_map not in COLOUR_MAPS:
        raise ValueError(f"colour map must be one of {', '.join(COLOUR_MAPS)}, got {colour_map!r}")
    try:
        tone = Tone(float(request["ceiling"]), float(np.clip(float(request["dynamic_range"]), 0.0, _MAX_DYNAMIC_RANGE)))
    except (KeyError, TypeError, ValueError):
        raise ValueError("a picture needs numbers for ceiling and dynamic_range") from None
    if not 0 < tone.ceiling < math.inf or math.isnan(tone.dynamic_range):
        got = f"{tone.ceiling} and {tone.dynamic_range}"
        raise ValueError(f"ceiling must be above 0 and finite, dynamic_range a number, got {got}")
    written = io.BytesIO()
    kind: Kind = "polar" if view == "polar" else "fan"
    save_png(sonar, written, kind, colour_map, tone, name=str(request.get("source", "")))
    return f"{name}.png", written.getvalue()


def raw_file(sonar: Sonar) -> bytes:
    """A sample as an .npz file with the keys that `sonar ping` writes."""
    written = io.BytesIO()
    np.savez_compressed(
        written,
        bins=sonar.bins,
        bearings=sonar.bearings,
        bin_duration=sonar.bin_duration,
        speed_of_sound=sonar.speed_of_sound,
        beam_width=sonar.beam_width,
        beam_height=sonar.beam_height,
        time=sonar.time,
    )
    return written.getvalue()
