"""Properties of a sonar: limits with their interval, and what is refused changes nothing."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from sonar_component.sonars.scanning_settings import ScanningSettings
from sonar_component.sonars.settings import ForwardLookingSettings

DEG = np.pi / 180


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("range", 1e4, "must be 0.1 m to 1000 m, got 10000 m"),
        ("range", float("nan"), "must be 0.1 m to 1000 m, got nan m"),
        ("min_range", -1.0, "must be 0 m to 1000 m, got -1 m"),
        ("min_range", 50.0, r"min_range must be below range \(50 m\), got 50 m"),
        ("beam_width", 361 * DEG, "must be 0.05 deg to 360 deg, got 361 deg"),
        ("beam_height", 151 * DEG, "must be 0.05 deg to 150 deg, got 151 deg"),
        ("accuracy", 0.0, "must be 0.001 to 0.2, got 0"),
        ("gain", 1.5, "must be 0 to 1, got 1.5"),
        ("bin_count", 0, "greater than or equal to 1"),
        ("bin_count", 4097, "less than or equal to 4096"),
        ("beam_count", 0, "greater than or equal to 1"),
        ("beam_count", 4097, "less than or equal to 4096"),
        ("bearings", [0.0, 0.1, 0.1], "without a repeat"),
        ("bearings", [0.0], "at least 2"),
        ("bearings", "equal_cosine", "equal_angle"),
        ("speed_of_sound", 340.0, "must be 1300 m/s to 1700 m/s, got 340 m/s"),
        ("normalization", "sum", "'mean' or 'energy'"),
        ("sigmoid_slope", float("inf"), "less than or equal to 1000"),
    ],
)
def test_what_is_refused_says_what_is_allowed_and_leaves_every_value_as_it_was(
    name: str, value: Any, message: str
) -> None:
    settings = ForwardLookingSettings()
    before = settings.model_dump()
    with pytest.raises(ValidationError, match=message):
        setattr(settings, name, value)
    assert settings.model_dump() == before
    settings.range = 40.0  # and it can still be used
    assert settings.range == 40.0


def test_a_fan_too_wide_for_its_table_is_refused_and_the_old_fan_stays() -> None:
    settings = ForwardLookingSettings(bearings="equal_sine")
    with pytest.raises(ValidationError, match="beam_width of at most 180 deg, got 200 deg"):
        settings.beam_width = 200 * DEG
    assert settings.beam_width == pytest.approx(120 * DEG)
    assert len(settings.beam_table().bearings) == 256


def test_a_scanning_sonar_keeps_what_it_had_too() -> None:
    settings = ScanningSettings(range=20.0)
    with pytest.raises(ValidationError, match="min_range must be below range"):
        settings.min_range = 30.0
    assert settings.min_range == 0.0


def test_a_list_of_bearings_sets_the_beams() -> None:
    table = ForwardLookingSettings(bearings=[-0.2, 0.0, 0.3], beam_count=77).beam_table()
    np.testing.assert_array_equal(table.bearings, [-0.2, 0.0, 0.3])
    assert table.width == pytest.approx(0.1 + 0.5 + 0.15)


@pytest.mark.parametrize(
    ("normalization", "transfer", "sigmoid"),
    [
        ("mean", None, (18.0, 2 / 3)),
        ("energy", None, None),
        ("mean", "linear", None),
        ("energy", "sigmoid", (18.0, 2 / 3)),
    ],
)
def test_the_transfer_follows_the_normalization_unless_it_is_named(
    normalization: Any, transfer: Any, sigmoid: Any
) -> None:
    assert ForwardLookingSettings(normalization=normalization, transfer=transfer).sigmoid == sigmoid
