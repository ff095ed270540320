"""YAML without YAML 1.1's traps, with every key's place."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sonar_component.settings import Document, SettingsError, load_yaml, overlay


def value_of(text: str) -> Any:
    return load_yaml("t.yaml", f"x: {text}\n").data["x"]


@pytest.mark.parametrize(
    ("text", "value"),  # the core schema of YAML 1.2, section 10.3.2
    [
        ("1e-3", 1e-3),  # text in YAML 1.1, for want of a point
        ("1E3", 1e3),
        ("+.5", 0.5),
        ("5.", 5.0),
        ("010", 10),  # 8 in YAML 1.1
        ("0o10", 8),
        ("0x1F", 31),
        ("-0", 0),
        ("12:30", "12:30"),  # 750 in YAML 1.1
        ("190:20:30", "190:20:30"),
        ("1_000", "1_000"),  # 1000 in YAML 1.1
        ("2026-11-22", "2026-11-22"),  # a date in YAML 1.1
        ("on", "on"),
        ("no", "no"),
        ("Yes", "Yes"),
        ("off", "off"),
        ("y", "y"),
        ("true", True),
        ("FALSE", False),
        ("null", None),
        ("~", None),
        ("", None),
        (".inf", math.inf),
        ("-.Inf", -math.inf),
        ("'010'", "010"),
        ("50 m", "50 m"),
        ("=", "="),
        ("<<", "<<"),
    ],
)
def test_scalars_follow_yaml_1_2(text: str, value: Any) -> None:
    read = value_of(text)
    assert (read, type(read)) == (value, type(value))


def test_nan_is_read_as_nan() -> None:
    assert math.isnan(value_of(".nan"))


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_every_float_that_python_prints_comes_back_bit_for_bit(number: float) -> None:
    assert value_of(repr(number)) == number


@given(st.integers(-(10**30), 10**30))
def test_every_integer_comes_back(number: int) -> None:
    assert value_of(str(number)) == number


NESTED = """\
# a comment
tasks:
  fls:
    properties: {range: 30 m,
                 gain: 0.5}
  list:
    - one
    - {two: 2}
"""


@pytest.mark.parametrize(
    ("path", "place"),
    [
        (("tasks",), (2, 1)),
        (("tasks", "fls"), (3, 3)),
        (("tasks", "fls", "properties", "range"), (4, 18)),
        (("tasks", "fls", "properties", "gain"), (5, 18)),
        (("tasks", "list", 1), (8, 7)),
        (("tasks", "list", 1, "two"), (8, 8)),
        (("tasks", "fls", "absent", "below"), (3, 3)),  # the nearest parent that is there
        ((), (2, 1)),
    ],
)
def test_each_key_knows_its_line_and_column(path: tuple[str | int, ...], place: tuple[int, int]) -> None:
    assert load_yaml("t.yaml", NESTED).position(path) == place


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: 1\nb: 2\na: 3\n", "t.yaml:3:1: a: stands twice, first in line 1"),
        ("t: {a: 1, a: 2}\n", "t.yaml:1:11: t.a: stands twice, first in line 1"),
        ("a: [1, 2\n", "t.yaml:2:1: is not YAML: "),
        ("a: 1\n\tb: 2\n", "t.yaml:2:1: is not YAML: "),
        ("a: 1\n---\nb: 2\n", "t.yaml:2:1: is not YAML: expected a single document"),
        ("a: *nothing\n", "t.yaml:1:4: is not YAML: found undefined alias"),
        ("a: !!python/object:os.system x\n", "t.yaml:1:4: is not YAML: could not determine a constructor"),
        ("a: !!int abc\n", "t.yaml: is not YAML: "),
        ("{a: 1}: 2\n", "t.yaml:1:1: is not YAML: "),
        ("a: &a [*a]\n", "t.yaml:1:4: is nested too deeply"),
        ("a: " + "[" * 60 + "]" * 60, "is nested too deeply"),
        ("a: " + "[" * 2000 + "]" * 2000, "t.yaml: is not YAML: "),
        ("a: \x07\n", "t.yaml: is not YAML: "),
    ],
)
def test_what_is_no_sound_yaml_is_refused_in_one_line_with_its_place(text: str, message: str) -> None:
    with pytest.raises(SettingsError) as caught:
        load_yaml("t.yaml", text)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_alias_bomb_is_refused_before_it_unfolds() -> None:
    bomb = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n"
    bomb += "".join(f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]\n" for n in range(1, 10))  # 9**10 items
    with pytest.raises(SettingsError, match="is nested too deeply"):
        load_yaml("t.yaml", bomb)


def test_an_honest_alias_is_read() -> None:
    document = load_yaml("t.yaml", "a: &a {x: 1}\nb: *a\n")
    assert document.data == {"a": {"x": 1}, "b": {"x": 1}}


@pytest.mark.parametrize(
    ("make", "words"), [("absent", "No such file"), ("folder", "Is a directory"), ("latin", "utf-8")]
)
def test_a_file_that_cannot_be_read_is_named_with_the_reason(tmp_path: Path, make: str, words: str) -> None:
    path = tmp_path / make
    if make == "folder":
        path.mkdir()
    if make == "latin":
        path.write_bytes("größe: 1".encode("latin-1"))
    with pytest.raises(SettingsError, match=words) as caught:
        load_yaml(path)
    assert str(caught.value).startswith(str(path))


def test_an_empty_file_is_no_data() -> None:
    assert load_yaml("t.yaml", "").data is None
    assert load_yaml("t.yaml", "# only words\n").data is None


def test_settings_laid_over_a_document_are_yaml_and_go_below_dots() -> None:
    document = load_yaml("t.yaml", "range: 30 m\nwater: {salinity: 35}\n")
    over = overlay(document, ["range=20 m", "bin_count=1e2", "water.acidity=8.1", "new.below=[1, 2]"], "--set")
    assert over.data == {
        "range": "20 m", "bin_count": 100.0, "water": {"salinity": 35, "acidity": 8.1}, "new": {"below": [1, 2]},
    }  # fmt: skip
    assert document.data == {"range": "30 m", "water": {"salinity": 35}}


def test_a_value_may_hold_an_equals_sign() -> None:
    assert overlay(Document({}, "t"), ["a=b=c"], "--set").data == {"a": "b=c"}


def test_an_empty_group_can_be_filled() -> None:
    assert overlay(load_yaml("t.yaml", "water:\n"), ["water.salinity=3"], "--set").data == {"water": {"salinity": 3}}


def test_a_mistake_laid_over_is_blamed_on_its_source_not_on_the_file() -> None:
    over = overlay(load_yaml("t.yaml", "range: 30 m\n"), ["range=0"], "--set")
    assert str(over.error(("range",), "is wrong")) == "--set: range: is wrong"


@pytest.mark.parametrize(
    ("text", "setting", "message"),
    [
        ("a: 1", "a", "--set: must be NAME=VALUE, got 'a'"),
        ("a: 1", "=1", "--set: must be NAME=VALUE, got '=1'"),
        ("a: 1", "a.b=1", "--set: a: has no keys below it"),
        ("a: 1", "b=[1", "is not YAML"),
        ("- a", "b=1", r"t.yaml:1:1: must be a mapping of keys to values, got \['a'\]"),
    ],
)
def test_a_setting_that_cannot_be_laid_over_is_refused(text: str, setting: str, message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        overlay(load_yaml("t.yaml", text), [setting], "--set")
