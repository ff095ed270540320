from __future__ import annotations

import json
import math
from typing import Annotated, Any, Literal

import pytest
from pydantic import BaseModel, Field

from sonar_component.middleware.deployment.task_types import task_type, task_type_names
from sonar_component.settings.quantity import (
    UNITS,
    Angle,
    AngularSpeed,
    Duration,
    Frequency,
    Length,
    Ratio,
    Temperature,
    parse,
)
from sonar_component.settings.written import quantity_text, written


class _Round(BaseModel):
    kind: Literal["round"] = "round"
    radius: Annotated[Length, Field(gt=0)] = 2.0


class _Straight(BaseModel):
    kind: Literal["straight"] = "straight"
    turn: AngularSpeed = math.pi / 4


class _Model(BaseModel):
    wide: Annotated[Angle, Field(gt=0)] = math.radians(120)
    rpy: tuple[Angle, Angle, Angle] = (0.0, math.radians(22), 0.0)
    ends: list[Length] = [1.0, 2.5]
    table: Literal["equal"] | list[Angle] = "equal"
    share: Ratio = 0.5
    count: int = 3
    on: bool = True
    name: str = "x"
    missing: Length | None = None
    path: Annotated[_Round | _Straight, Field(discriminator="kind")] | None = None
    tone: Frequency = 720e3


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("wide", math.radians(120), "120 deg"),
        ("rpy", [0.0, math.radians(22), 0.0], ["0 deg", "22 deg", "0 deg"]),
        ("ends", [1.0, 2.5], ["1 m", "2.5 m"]),
        ("table", "equal", "equal"),
        ("table", [math.radians(-30), 0.0], ["-30 deg", "0 deg"]),
        ("share", 0.5, 0.5),
        ("count", 3, 3),
        ("on", True, True),
        ("name", "x", "x"),
        ("missing", None, None),
        ("missing", 3.0, "3 m"),
        ("path", None, None),
        ("path", {"kind": "round", "radius": 17.0}, {"kind": "round", "radius": "17 m"}),
        ("path", {"kind": "straight", "turn": math.pi / 4}, {"kind": "straight", "turn": "45 deg/s"}),
        ("path", {"kind": "unknown", "speed": 1.0}, {"kind": "unknown", "speed": 1.0}),
        ("tone", 720e3, "720 kHz"),
    ],
)
def test_a_value_is_written_with_the_unit_that_people_use(name: str, value: object, expected: object) -> None:
    assert written(_Model, name, value) == expected


@pytest.mark.parametrize("dimension", UNITS)
@pytest.mark.parametrize("value", [0.0, 1e-7, -0.0123456789012, 0.349065850398866, 298.15, 15e6])
def test_what_is_written_is_read_again(dimension: str, value: float) -> None:
    # Nine significant digits, of the number in its unit: degrees Celsius move the point by 273 K.
    offset = 273.15 if dimension == "temperature" else 0.0
    again = parse(quantity_text(value, dimension), dimension)
    assert again == pytest.approx(value, rel=1e-8, abs=1e-8 * offset)


def test_small_durations_are_told_in_small_units() -> None:
    told = [quantity_text(value, "duration") for value in (0.0, 5e-7, 32e-6, 0.1, 1.0, 3600.0)]
    assert told == ["0 s", "0.5 us", "32 us", "100 ms", "1 s", "3600 s"]


@pytest.mark.parametrize("name", task_type_names())
def test_the_properties_of_every_task_are_taken_back_as_they_are_written(name: str) -> None:
    kind = task_type(name).Properties
    required = {key: "here" for key, field in kind.model_fields.items() if field.is_required()}
    values = kind.model_validate(required).model_dump(mode="json")
    told = json.loads(json.dumps({key: written(kind, key, value) for key, value in values.items()}, allow_nan=False))
    _is_close(kind.model_validate(told).model_dump(mode="json"), values)


def _is_close(one: Any, other: Any) -> None:
    """Equal, but for the digits that are not written."""
    assert type(one) is type(other)
    if isinstance(one, dict):
        assert one.keys() == other.keys()
        one, other = list(one.values()), list(other.values())
    if isinstance(one, list):
        for a, b in zip(one, other, strict=True):
            _is_close(a, b)
    else:
        assert one == (pytest.approx(other, rel=1e-8) if isinstance(other, float) else other)


def test_a_temperature_is_told_in_degrees_celsius() -> None:
    class Water(BaseModel):
        temperature: Temperature = 298.15
        wait: Duration = 0.25

    assert (written(Water, "temperature", 298.15), written(Water, "wait", 0.25)) == ("25 degC", "250 ms")
