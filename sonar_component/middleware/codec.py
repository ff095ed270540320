"""Sample <-> header and raw buffers; pure, no sockets. The format is written down in README.md beside this file.

Arrays up to `INLINE_BYTES` stand in the header itself, since one frame less is worth more there than one copy: a pose
has eight of them and travels in two frames instead of ten, a sonar image with its bearings in three instead of four. A
list of numbers in msgpack was the alternative for large ones; it takes about 250 times as long as the raw buffer.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import msgpack
import numpy as np

from sonar_component.middleware.schema import DTYPES, Schema, schema_of, wire_dtype

ENVELOPE = 1
INLINE_BYTES = 4096
MAX_DIMENSIONS = 8
MAX_ARRAYS = 256
MAX_HEADER_BYTES = 4 << 20  # far above any header of ours; the largest holds the names of a scene's bodies
_REQUIRED: dict[str, type] = {
    "e": int, "type": str, "sv": list, "sh": str, "src": str, "run": str, "seq": int, "t": int, "tp": int, "clk": str,
}  # fmt: skip


class WireError(ValueError):
    """A message that does not follow the format; the text says what is wrong with it."""


@dataclass(frozen=True)
class Header:
    """The envelope of one sample.

    Attributes
    ----------
    type, version, schema_hash : the sample type as the sender knows it.
    source : ``task.port`` of the sender.
    run : changes with each start of the sender, so that a sequence that begins anew is not taken for loss.
    seq : counts the samples of that port in that run, from 1.
    time : data time [us], of the clock named in ``clock`` ("wall" or "sim").
    published : wall time at which the sample was written [us].
    """

    type: str
    version: tuple[int, int]
    schema_hash: str
    source: str
    run: str
    seq: int
    time: int
    published: int
    clock: str


def encode(sample: Any, envelope: dict[str, Any]) -> list[Any]:
    """Turn a sample into frames: the packed header, then one buffer for each large array.

    Parameters
    ----------
    sample : a dataclass that `schema_of` accepts.
    envelope : the header without ``body`` and ``arr``.
    """
    cls: type = type(sample)
    schema = schema_of(cls)
    body: dict[str, Any] = {}
    described: list[list[Any]] = []
    buffers: list[Any] = []
    values = sample.__dict__
    for name, kind, dtype, dtype_name in schema.plan:
        value = values[name]
        if kind is not None:
            body[name] = kind(value)
            continue
        array = contiguous(value, dtype)
        if array.nbytes <= INLINE_BYTES:
            described.append([name, dtype_name or array.dtype.str, array.shape, array.tobytes()])
        else:
            described.append([name, dtype_name or array.dtype.str, array.shape])
            buffers.append(array)
    return [_pack({**envelope, "body": body, "arr": described}), *buffers]


class _Packers(threading.local):
    """A packer for each thread: one for each message asks the system for 256 kB, and gives them back."""

    def __init__(self) -> None:
        self.packer = msgpack.Packer()


_packers = _Packers()


def _pack(header: dict[str, Any]) -> bytes:
    packer = _packers.packer
    try:
        packed: bytes = packer.pack(header)
    except Exception:
        packer.reset()  # it keeps what it had packed before the value that it cannot
        raise
    return packed


def contiguous(value: Any, wanted: np.dtype[Any] | None) -> np.ndarray[Any, Any]:
    """The value as an array of the wanted dtype, or of its own, as it travels."""
    dtype = wanted or DTYPES[wire_dtype(np.asarray(value).dtype)]
    if type(value) is np.ndarray and value.dtype == dtype and value.flags.c_contiguous:
        return value
    return np.ascontiguousarray(value, dtype).reshape(np.shape(value))


def unpack(frame: Any) -> dict[str, Any]:
    """Read a header frame without its arrays.

    Raises
    ------
    WireError
        If it is not a header of this envelope version.
    """
    if len(frame) > MAX_HEADER_BYTES:
        raise WireError(f"header of {len(frame)} bytes, at most {MAX_HEADER_BYTES}")
    try:
        header = msgpack.unpackb(frame, strict_map_key=True)
    except Exception as error:  # msgpack raises a dozen types for the same fact
        raise WireError(f"header is not msgpack: {type(error).__name__}") from None
    if not isinstance(header, dict):
        raise WireError(f"header is not a map but {type(header).__name__}")
    for key, kind in _REQUIRED.items():
        if type(header.get(key)) is not kind:  # not isinstance: True is no int on the wire
            raise WireError(f"header field {key!r} must be {kind.__name__}, got {_brief(header.get(key))}")
    if header["e"] != ENVELOPE:
        raise WireError(f"envelope version {_brief(header['e'])}, this reader knows {ENVELOPE}")
    version = header["sv"]
    if len(version) != 2 or not all(type(part) is int for part in version):
        raise WireError(f"schema version must be [major, minor], got {_brief(version)}")
    return header


def envelope_of(header: dict[str, Any]) -> Header:
    """The typed envelope of an unpacked header."""
    h = header
    return Header(h["type"], tuple(h["sv"]), h["sh"], h["src"], h["run"], h["seq"], h["t"], h["tp"], h["clk"])


def decode(schema: Schema, header: dict[str, Any], buffers: Sequence[Any]) -> Any:
    """Rebuild a sample; its large arrays are read-only views of the buffers.

    Raises
    ------
    WireError
        If type, fields or sizes do not fit the schema. Fields that the schema does not have are skipped, and fields
        that did not come keep their defaults.
    """
    if header["type"] != schema.name or header["sv"][0] != schema.major:
        got = f"{_brief(header['type'])} version {_brief(header['sv'][0])}"
        raise WireError(f"sample is {got}, this port takes {schema.name} version {schema.major}")
    body, arrays = header.get("body"), _arrays(header.get("arr"), buffers)
    if not isinstance(body, dict):
        raise WireError(f"header field 'body' must be dict, got {_brief(body)}")
    values: dict[str, Any] = {}
    for name, kind, dtype, _ in schema.plan:
        if kind is not None:
            if name in body:
                value = body[name]
                values[name] = value if type(value) is kind else _scalar(name, kind, value)
        elif name in arrays:
            array = values[name] = arrays[name]
            if dtype is not None and array.dtype != dtype:
                raise WireError(f"array {name!r} must be {dtype.str}, got {array.dtype.str}")
    try:
        return schema.cls(**values)
    except TypeError:  # a field without a default is missing
        missing = ", ".join(field.name for field in schema.fields if field.name not in values)
        raise WireError(f"{schema.name} lacks {missing}") from None


def decode_untyped(header: dict[str, Any], buffers: Sequence[Any]) -> SimpleNamespace:
    """Rebuild a sample whose type is not installed here, as a namespace of its fields.

    Raises
    ------
    WireError
        If sizes do not fit.
    """
    body, arrays = header.get("body"), _arrays(header.get("arr"), buffers)
    if not isinstance(body, dict) or not all(type(key) is str for key in body):
        raise WireError("header field 'body' must be a map with text keys")
    return SimpleNamespace(**body, **{name: array for name, array in arrays.items() if name not in body})


def _scalar(name: str, kind: type, value: Any) -> Any:
    if kind is float and type(value) is int:  # other languages write whole numbers so
        return float(value)
    raise WireError(f"field {name!r} must be {kind.__name__}, got {_brief(value)}")


def _arrays(described: Any, buffers: Sequence[Any]) -> dict[str, np.ndarray[Any, Any]]:
    if type(described) is not list or len(described) > MAX_ARRAYS:
        raise WireError(f"header field 'arr' must be a list of at most {MAX_ARRAYS} arrays")
    waiting = iter(buffers)
    found: dict[str, np.ndarray[Any, Any]] = {}
    for entry in described:
        if type(entry) is not list or len(entry) not in (3, 4) or type(entry[0]) is not str:
            raise WireError(f"array entry must be [name, dtype, shape] and maybe data, got {_brief(entry)}")
        data = entry[3] if len(entry) == 4 else next(waiting, None)
        if data is None:
            raise WireError(f"array {entry[0]!r} has no buffer: {len(buffers)} came")
        found[entry[0]] = _array(entry[0], entry[1], entry[2], data)
    if next(waiting, None) is not None:
        raise WireError(f"{len(buffers)} buffers came, more than arrays described")
    return found


def _array(name: str, kind: Any, shape: Any, data: Any) -> np.ndarray[Any, Any]:
    dtype = DTYPES.get(kind) if type(kind) is str else None
    if dtype is None:
        raise WireError(f"array {name!r}: dtype {_brief(kind)} is not allowed")
    if type(shape) is not list or len(shape) > MAX_DIMENSIONS:
        raise WireError(f"array {name!r}: shape {_brief(shape)} is not allowed")
    expected = dtype.itemsize
    for size in shape:
        if type(size) is not int or size < 0:
            raise WireError(f"array {name!r}: shape {_brief(shape)} is not allowed")
        expected *= size
    if type(data) is not bytes and type(data) is not memoryview:
        raise WireError(f"array {name!r}: data must be bytes, got {_brief(data)}")
    if expected != len(data):
        raise WireError(f"array {name!r}: {kind} {_brief(shape)} takes {expected} bytes, {len(data)} came")
    array = np.frombuffer(data, dtype)
    return array if len(shape) == 1 else array.reshape(shape)


def _brief(value: Any) -> str:
    """At most 60 characters of a stranger's value."""
    try:
        text = repr(value)
    except (ValueError, RecursionError):
        text = type(value).__name__  # an integer of more digits than Python prints
    return text if len(text) <= 60 else text[:57] + "..."
