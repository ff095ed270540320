"""How an image travels to the page: one binary message with a JSON header and raw arrays.

    [u32 little-endian: length of the header] [header, JSON, padded with blanks to 8 bytes] [array] [array] ...

The header's ``arrays`` lists name, dtype and shape of each array; each begins on 8 bytes, so that the page reads it in
place. Echo strengths travel as they are, float32: the page's cursor shows the value that the sonar sent. A JPEG or an
8-bit picture would be a tenth of the size, but then gain, colours and cursor would need the server for every change.
A page that lost some versions is sent just the rows that changed since the last one it drew.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sonar_component.samples import Frame
from sonar_component.tasks.page.board import Channel

_ALIGNMENT = 8  # bytes, of the widest element


def pack(header: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> bytes:
    """One message of a header and arrays."""
    listed = [[name, array.dtype.str, list(array.shape)] for name, array in arrays.items()]
    text = json.dumps({**header, "arrays": listed}, allow_nan=False).encode()
    text += b" " * (-(4 + len(text)) % _ALIGNMENT)
    parts = [len(text).to_bytes(4, "little"), text]
    for array in arrays.values():
        parts += [array.tobytes(), b"\0" * (-array.nbytes % _ALIGNMENT)]
    return b"".join(parts)


def pack_image(channel: Channel, since: int, age: float | None) -> bytes:
    """What changed in a channel after version ``since``.

    Parameters
    ----------
    age : float or None
        Now minus the image's data time [s], on the clock that stamped it.
    """
    sonar, sweep = channel.latest, channel.sweep
    assert sonar is not None
    if sweep is None:
        beams, bearings, rows, bins = sonar.beam_count, sonar.bearings, np.arange(sonar.beam_count), sonar.bins
    else:
        beams, bearings, rows = len(sweep.bins), sweep.bearings, np.flatnonzero(channel.row_version > since)
        bins = sweep.bins[rows]
    header = {
        "kind": "image",
        "source": channel.source,
        "version": channel.version,
        "time": sonar.time,
        "age": age,
        "beams": beams,
        "bins": sonar.bin_count,
        "bin_length": sonar.bin_length,
        "speed_of_sound": sonar.speed_of_sound,
        "beam_width": _or_none(sonar.beam_width),
        "beam_height": _or_none(sonar.beam_height),
        "head": None if sweep is None else _or_none(sweep.head),
        "restarts": 0 if sweep is None else sweep.restarts,
        "ceiling": channel.ceiling,
    }
    arrays = {"bearings": bearings.astype("<f8"), "rows": rows.astype("<i4"), "values": bins.astype("<f4", copy=False)}
    return pack(header, arrays)


def pack_camera(frame: Frame, version: int, age: float | None) -> bytes:
    """A camera frame, uncompressed: the page draws it as it is."""
    header = {"kind": "camera", "version": version, "time": frame.time, "age": age}
    return pack(header, {"image": np.asarray(frame.image, np.uint8)})


def _or_none(value: float) -> float | None:
    """JSON has no NaN."""
    return float(value) if np.isfinite(value) else None
