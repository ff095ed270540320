"""Numbers with units, against the definitions of the units."""

from __future__ import annotations

import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sonar_component.settings.quantity import UNITS, describe, parse


@pytest.mark.parametrize(
    ("text", "dimension", "value"),
    [
        ("50 m", "length", 50.0),
        ("50m", "length", 50.0),
        ("  1.5e2 cm ", "length", 1.5),
        ("-3 mm", "length", -0.003),
        ("2 km", "length", 2000.0),
        ("180 deg", "angle", math.pi),
        ("200 grad", "angle", math.pi),
        ("720 kHz", "frequency", 720e3),
        ("1.2 MHz", "frequency", 1.2e6),
        ("500 us", "duration", 5e-4),
        ("2 min", "duration", 120.0),
        ("1 kn", "speed", 1852 / 3600),  # the international knot: one nautical mile of 1852 m an hour
        ("36 km/h", "speed", 10.0),
        ("60 rpm", "angular speed", 2 * math.pi),
        ("0 degC", "temperature", 273.15),
        ("25 degC", "temperature", 298.15),
        ("50 %", "ratio", 0.5),
        ("50%", "ratio", 0.5),
        ("35 ppt", "salinity", 35.0),
        ("30 dB/km", "attenuation", 0.03),
        (".5 m", "length", 0.5),
        ("5. m", "length", 5.0),
        ("7", "length", 7.0),
        (7, "length", 7.0),
        (7.5, "angle", 7.5),
    ],
)
def test_a_unit_turns_a_number_into_si(text: object, dimension: str, value: float) -> None:
    # One rounding of the factor and one of the product, each half a unit in the last place.
    assert parse(text, dimension) == pytest.approx(value, rel=4e-16)


@pytest.mark.parametrize(
    ("value", "dimension", "message"),
    [
        ("50 deg", "length", "must be of length (m, mm, cm, km): 'deg' is of angle, got '50 deg'"),
        ("50 M", "length", "'M' is not a unit known here"),
        ("50 metres", "length", "'metres' is not a unit known here"),
        ("m", "length", "must be a number with a unit of length (m, mm, cm, km), got 'm'"),
        ("", "length", "must be a number"),
        ("1.2.3 m", "length", "must be"),
        ("nan m", "length", "must be a number"),
        ("inf", "length", "must be a number"),
        ("1e m", "length", "must be"),
        ("0x10 m", "length", "must be"),
        ("1,5 m", "length", "must be"),
        ("50 m 3", "length", "not a unit"),
        (True, "length", "must be a number with a unit of length (m, mm, cm, km), got True"),
        (None, "angle", "got None"),
        ([1], "angle", "got [1]"),
        ("3 m", "ratio", "must be of ratio (%): 'm' is of length"),
    ],
)
def test_a_wrong_dimension_or_no_number_is_refused_with_what_is_allowed(
    value: object, dimension: str, message: str
) -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        parse(value, dimension)


@given(st.floats(-1e12, 1e12), st.sampled_from([(d, u) for d, units in UNITS.items() for u in units if u]))
def test_every_unit_is_linear(number: float, unit: tuple[str, str]) -> None:
    dimension, name = unit
    factor, offset = UNITS[dimension][name]
    assert parse(f"{number!r} {name}", dimension) == number * factor + offset


@pytest.mark.parametrize(
    ("value", "dimension", "text"),
    [
        (math.pi / 3, "angle", "60 deg"),
        (30.0, "length", "30 m"),
        (0.5, "ratio", "0.5"),
        (298.15, "temperature", "298.15 K"),
        (1e-7, "length", "1e-07 m"),
    ],
)
def test_messages_name_the_unit(value: float, dimension: str, text: str) -> None:
    assert describe(value, dimension) == text


@pytest.mark.parametrize("dimension", list(UNITS))
def test_what_a_message_prints_can_be_read_again(dimension: str) -> None:
    assert parse(describe(0.25, dimension), dimension) == pytest.approx(0.25, rel=1e-5)  # six digits are printed
