"""Numbers with units: text such as ``50 m`` or ``120 deg`` to a float in SI.

A small table of our own: the units of a sonar are few, and pint costs 0.3 s of start-up for them.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import BeforeValidator

_DEGREE = math.pi / 180

# dimension -> unit -> (factor, offset): SI = value * factor + offset
UNITS: dict[str, dict[str, tuple[float, float]]] = {
    "length": {"m": (1, 0), "mm": (1e-3, 0), "cm": (1e-2, 0), "km": (1e3, 0)},
    "angle": {"rad": (1, 0), "deg": (_DEGREE, 0), "grad": (math.pi / 200, 0), "mrad": (1e-3, 0)},
    "duration": {"s": (1, 0), "ms": (1e-3, 0), "us": (1e-6, 0), "ns": (1e-9, 0), "min": (60, 0)},
    "frequency": {"Hz": (1, 0), "kHz": (1e3, 0), "MHz": (1e6, 0)},
    "speed": {"m/s": (1, 0), "mm/s": (1e-3, 0), "cm/s": (1e-2, 0), "km/h": (1 / 3.6, 0), "kn": (1852 / 3600, 0)},
    "angular speed": {"rad/s": (1, 0), "deg/s": (_DEGREE, 0), "rpm": (math.pi / 30, 0)},
    "temperature": {"K": (1, 0), "degC": (1, 273.15)},
    "ratio": {"": (1, 0), "%": (1e-2, 0)},
    "salinity": {"": (1, 0), "ppt": (1, 0), "psu": (1, 0)},
    "attenuation": {"dB/m": (1, 0), "dB/km": (1e-3, 0)},
    "level": {"dB": (1, 0)},
}
_SI = {dimension: next(iter(units)) for dimension, units in UNITS.items()}
_NUMBER_AND_UNIT = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S.*?)?\s*$")


@dataclass(frozen=True)
class Dimension:
    """Marks a field as a quantity, so that messages about it can name its unit."""

    name: str


def parse(value: Any, dimension: str) -> float:
    """Turn a number (SI) or a text with a unit into a float in SI.

    Raises
    ------
    ValueError
        If the text is not a number with a unit of this dimension; says which units are allowed.
    """
    allowed = ", ".join(unit for unit in UNITS[dimension] if unit)
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ValueError(f"must be a number with a unit of {dimension} ({allowed or 'none'}), got {value!r}")
    if isinstance(value, (int, float)):
        return float(value)
    match = _NUMBER_AND_UNIT.match(value)
    if match is None:
        raise ValueError(f"must be a number with a unit of {dimension} ({allowed or 'none'}), got {value!r}")
    number, unit = float(match[1]), match[2] or ""
    if unit == "":
        return number
    if unit not in UNITS[dimension]:
        other = next((name for name, units in UNITS.items() if unit in units), None)
        reason = f"is of {other}" if other else "is not a unit known here"
        raise ValueError(f"must be of {dimension} ({allowed or 'no unit'}): {unit!r} {reason}, got {value!r}")
    factor, offset = UNITS[dimension][unit]
    return number * factor + offset


def describe(value: float, dimension: str) -> str:
    """``30 m`` and so on: the value with its SI unit, angles in degrees as people think of them, for messages."""
    if dimension == "angle":
        return f"{value / _DEGREE:.6g} deg"
    return f"{value:.6g} {_SI[dimension]}".rstrip()


def _quantity(dimension: str) -> BeforeValidator:
    return BeforeValidator(lambda value: parse(value, dimension), json_schema_input_type=float | str)


Length = Annotated[float, _quantity("length"), Dimension("length")]
Angle = Annotated[float, _quantity("angle"), Dimension("angle")]
Duration = Annotated[float, _quantity("duration"), Dimension("duration")]
Frequency = Annotated[float, _quantity("frequency"), Dimension("frequency")]
Speed = Annotated[float, _quantity("speed"), Dimension("speed")]
AngularSpeed = Annotated[float, _quantity("angular speed"), Dimension("angular speed")]
Temperature = Annotated[float, _quantity("temperature"), Dimension("temperature")]
Ratio = Annotated[float, _quantity("ratio"), Dimension("ratio")]
Salinity = Annotated[float, _quantity("salinity"), Dimension("salinity")]
Attenuation = Annotated[float, _quantity("attenuation"), Dimension("attenuation")]
Level = Annotated[float, _quantity("level"), Dimension("level")]
