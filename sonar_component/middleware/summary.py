"""A sample in a few lines: scalars as they are, arrays by size and statistics."""

from __future__ import annotations

from typing import Any

import numpy as np

SHORT = 16  # elements of an array that are still printed one by one


def summary(sample: Any) -> dict[str, Any]:
    """Field -> value; a long array as dtype, shape, min, mean, max and the share of NaN."""
    return {name: _array(value) if isinstance(value, np.ndarray) else value for name, value in vars(sample).items()}


def _array(array: np.ndarray[Any, Any]) -> Any:
    if array.size <= SHORT:
        return [None if value != value else value for value in array.ravel().tolist()]  # NaN is no JSON
    head: dict[str, Any] = {"dtype": str(array.dtype), "shape": list(array.shape)}
    finite = array[np.isfinite(array)] if array.dtype.kind == "f" else array
    if finite.size:
        head |= {"min": float(finite.min()), "mean": float(finite.mean(dtype=np.float64)), "max": float(finite.max())}
    if finite.size < array.size:
        head["unknown"] = 1 - finite.size / array.size
    return head


def as_text(fields: dict[str, Any]) -> str:
    """One line for each field."""
    return "\n".join(f"{name}: {_value(value)}" for name, value in fields.items())


def _value(value: Any) -> str:
    if isinstance(value, dict):
        statistics = ", ".join(f"{key} {value[key]:.4g}" for key in ("min", "mean", "max", "unknown") if key in value)
        return f"{value['dtype']} {' x '.join(map(str, value['shape']))}  {statistics}"
    if isinstance(value, list):
        return "[" + ", ".join("nan" if v is None else f"{v:.6g}" for v in value) + "]"
    text = str(value)
    return text if len(text) <= 200 else f"{text[:200]}... ({len(text)} characters)"
