"""Mistakes in the user's words: where, what is allowed, what was got, what was meant."""

from __future__ import annotations

from typing import Annotated, Literal

import pytest
from pydantic import BaseModel, ConfigDict, Field, model_validator

from sonar_component.settings import SettingsErrors, load_yaml, overlay, validate
from sonar_component.settings.quantity import Angle, Frequency, Length, Temperature


class Water(BaseModel):
    model_config = ConfigDict(extra="forbid")
    temperature: Annotated[Temperature, Field(ge=267.15, le=308.15)] = 298.15
    salinity: float = 0.0


class Circle(BaseModel):
    kind: Literal["circle"]
    radius: Annotated[Length, Field(gt=0)]


class Line(BaseModel):
    kind: Literal["line"]
    length: Length


class Settings(BaseModel):
    model_config = ConfigDict(extra="forbid")
    range: Annotated[Length, Field(gt=0, le=150)] = 50.0
    width: Annotated[Angle, Field(gt=0, lt=6.2831)] = 1.0
    frequency: Frequency = 300e3
    bin_count: Annotated[int, Field(ge=1)] = 500
    water: Water = Water()
    bearings: Literal["equal_angle", "equal_sine"] | list[Angle] = "equal_angle"
    path: Annotated[Circle | Line, Field(discriminator="kind")] | None = None
    needed: str

    @model_validator(mode="after")
    def _range_and_count_fit(self) -> Settings:
        if self.bin_count > 1000 and self.range < 1:
            raise ValueError(f"bins must be 1 mm at least, got {1e3 * self.range / self.bin_count:.2g} mm")
        return self


def mistakes(text: str, *settings: str) -> list[str]:
    document = overlay(load_yaml("t.yaml", text), list(settings), "--set")
    with pytest.raises(SettingsErrors) as caught:
        validate(Settings, document)
    assert str(caught.value) == "\n".join(str(error) for error in caught.value.errors)
    return str(caught.value).splitlines()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("range: 0 m", "t.yaml:2:1: range: must be above 0 m, got '0 m'"),
        ("range: 500 m", "t.yaml:2:1: range: must be at most 150 m, got '500 m'"),
        ("range: .nan", "t.yaml:2:1: range: must be above 0 m, got nan"),
        ("range: 30 deg", "t.yaml:2:1: range: must be of length (m, mm, cm, km): 'deg' is of angle, got '30 deg'"),
        ("width: 400 deg", "t.yaml:2:1: width: must be below 359.995 deg, got '400 deg'"),
        ("bin_count: 0", "t.yaml:2:1: bin_count: must be at least 1, got 0"),
        ("bin_count: 0.5", "t.yaml:2:1: bin_count: must be a whole number, got 0.5"),
        ("bin_count: many", "t.yaml:2:1: bin_count: must be a whole number, got 'many'"),
        ("rnage: 3 m", 't.yaml:2:1: rnage: is not a known key (did you mean "range"?)'),
        (
            "zzz: 3",
            "t.yaml:2:1: zzz: is not a known key; "
            "allowed: range, width, frequency, bin_count, water, bearings, path, needed",
        ),
        ("water: {salinty: 3}", 't.yaml:2:9: water.salinty: is not a known key (did you mean "salinity"?)'),
        ("water: 3", "t.yaml:2:1: water: must be a mapping of keys to values, got 3"),
        ("needed: 3", "t.yaml:2:1: needed: must be a valid string, got 3"),
        ("bearings: [1 deg, 2 m]", "bearings.1: must be of angle (rad, deg, grad, mrad): 'm' is of length, got '2 m'"),
        ("bearings: sine", "bearings: must be 'equal_angle' or 'equal_sine', or must be a list, got 'sine'"),
        ("path: {kind: circle, radius: -1 m}", "t.yaml:2:22: path.radius: must be above 0 m, got '-1 m'"),
        ("path: {kind: circle}", "t.yaml:2:1: path.radius: is required"),
        ("path: {kind: square}", "t.yaml:2:8: path.kind: must be one of 'circle', 'line', got 'square'"),
        ("{range: 0.5 m, bin_count: 2000}", "t.yaml:1:1: bins must be 1 mm at least, got 0.25 mm"),
    ],
)
def test_a_mistake_says_where_what_is_allowed_and_what_was_got(text: str, message: str) -> None:
    whole = text.replace("{range", "{needed: x, range") if text.startswith("{") else f"needed: x\n{text}\n"
    if text.startswith("needed"):
        whole = f"# first line\n{text}\n"
    lines = mistakes(whole)
    assert len(lines) == 1
    assert message in lines[0]


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("width: 120", '"120 deg"'),  # as a number it is 120 rad
        ("range: 30000", '"30000 mm"'),
        ("water: {temperature: 20}", '"20 degC"'),
    ],
)
def test_a_bare_number_that_only_fits_another_unit_gets_that_unit_suggested(text: str, meant: str) -> None:
    assert mistakes(f"needed: x\n{text}\n")[0].endswith(f"(did you mean {meant}?)")


def test_no_unit_is_suggested_where_none_helps() -> None:
    assert "did you mean" not in mistakes("needed: x\nbin_count: -5\n")[0]


def test_all_mistakes_are_told_at_once_in_the_order_of_the_file() -> None:
    lines = mistakes("bin_count: 0\nrange: 0 m\nrnage: 1\n")
    assert [line.split(": ")[0] for line in lines] == ["t.yaml:1:1", "t.yaml:1:1", "t.yaml:2:1", "t.yaml:3:1"]
    assert "needed: is required" in "\n".join(lines)


def test_a_mistake_on_the_command_line_is_not_blamed_on_the_file() -> None:
    assert mistakes("needed: x\nrange: 3 m\n", "range=0") == ["--set: range: must be above 0 m, got 0"]


def test_a_document_without_keys_is_refused() -> None:
    for text in ("- a\n", "just words\n", ""):
        with pytest.raises(SettingsErrors, match="must be a mapping of keys to values"):
            validate(Settings, load_yaml("t.yaml", text))


def test_a_part_of_a_document_is_validated_in_its_place() -> None:
    document = load_yaml("t.yaml", "tasks:\n  fls:\n    needed: x\n    range: 20 m\n")
    assert validate(Settings, document, ("tasks", "fls")).range == 20.0
    document = load_yaml("t.yaml", "tasks:\n  fls:\n    needed: x\n    range: 0 m\n")
    with pytest.raises(SettingsErrors, match=r"t\.yaml:4:5: tasks\.fls\.range: must be above 0 m"):
        validate(Settings, document, ("tasks", "fls"))
