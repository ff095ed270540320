"""What a sample type looks like on the wire: its name, version and fields, read from the dataclass itself.

A hand-written or generated interface file (IDL) was the alternative; it would say the same thing twice and drift.
"""

from __future__ import annotations

import dataclasses
import hashlib
import typing
from functools import cache
from typing import Any

import numpy as np

# What numpy may rebuild from bytes of a stranger: plain numbers only. Structured, text and object types stay out.
_NUMBERS = ("|b1", "|u1", "|i1", "<u2", "<i2", "<u4", "<i4", "<u8", "<i8", "<f2", "<f4", "<f8")
DTYPES = {kind: np.dtype(kind) for kind in _NUMBERS}
_KINDS: dict[str, type] = {"int": int, "float": float, "str": str, "bool": bool}
_SCALARS = {kind: name for name, kind in _KINDS.items()}


@dataclasses.dataclass(frozen=True)
class Field:
    """One field: ``kind`` is int, float, str, bool or array; ``dtype`` is empty where any allowed one may come."""

    name: str
    kind: str
    dtype: str = ""


@dataclasses.dataclass(frozen=True)
class Schema:
    """A sample type as both ends must understand it.

    Attributes
    ----------
    cls : the dataclass.
    name : its name on the wire.
    major, minor : ``schema_version`` of the class, (1, 0) where it has none. Another major is refused at connect
        time; a minor only adds fields, which older readers skip.
    fields : in the order of the class.
    hash : 16 hexadecimal digits over name, major and fields.
    plan : for the codec's loop: name, Python type or None for an array, dtype or None for any, its name on the wire.
    """

    cls: type
    name: str
    major: int
    minor: int
    fields: tuple[Field, ...]
    hash: str
    plan: tuple[tuple[str, type | None, np.dtype[Any] | None, str], ...]


@cache
def schema_of(cls: type) -> Schema:
    """The schema of a dataclass.

    Raises
    ------
    TypeError
        If a field is neither a number, text, truth value nor numpy array.
    """
    hints = typing.get_type_hints(cls)
    fields = tuple(_field(cls, field.name, hints[field.name]) for field in dataclasses.fields(cls))
    major, minor = getattr(cls, "schema_version", (1, 0))
    text = ";".join([cls.__name__, str(major), *(f"{f.name}:{f.kind}{f.dtype}" for f in fields)])
    digest = hashlib.sha256(text.encode()).hexdigest()[:16]
    plan = tuple((f.name, _KINDS.get(f.kind), DTYPES.get(f.dtype), f.dtype) for f in fields)
    return Schema(cls, cls.__name__, major, minor, fields, digest, plan)


def _field(cls: type, name: str, hint: Any) -> Field:
    if hint in _SCALARS:
        return Field(name, _SCALARS[hint])
    array = _unfolded(hint)
    if typing.get_origin(array) is np.ndarray:
        scalar = typing.get_args(typing.get_args(array)[1])[0]
        if scalar in (np.generic, Any):
            return Field(name, "array")
        return Field(name, "array", wire_dtype(np.dtype(scalar)))
    raise TypeError(f"{cls.__name__}.{name}: a sample holds int, float, str, bool and arrays, not {hint}")


def _unfolded(hint: Any) -> Any:
    """``NDArray[T]`` as ``ndarray[shape, dtype[T]]``: with numpy 2.5 it is an alias that keeps its name."""
    value = getattr(typing.get_origin(hint), "__value__", None)
    return hint if value is None else value[typing.get_args(hint)]


def wire_dtype(dtype: np.dtype[Any]) -> str:
    """The dtype's name on the wire: always little-endian.

    Raises
    ------
    TypeError
        If it is not one of `DTYPES`.
    """
    name = dtype.newbyteorder("<").str
    if name not in DTYPES:
        raise TypeError(f"arrays of {dtype} do not travel; allowed: {', '.join(sorted(DTYPES))}")
    return name
