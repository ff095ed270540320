"""base::samples::Sonar's fields, units and rules."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from sonar_component.samples import Sonar


def an_image(beams: int = 4, bins: int = 5, /, **changes: Any) -> Sonar:
    values: dict[str, Any] = {
        "time": 1, "bin_duration": 40e-6, "beam_width": 2.0, "beam_height": 0.3, "bin_count": bins, "beam_count": beams,
        "bearings": np.linspace(1, -1, beams), "bins": np.zeros((beams, bins), np.float32),
    }  # fmt: skip
    return Sonar(**(values | changes))


def test_the_fields_are_those_of_rock() -> None:
    rock = (
        "time timestamps bin_duration beam_width beam_height bearings speed_of_sound bin_count beam_count bins".split()
    )
    assert [field.name for field in fields(Sonar)][: len(rock)] == rock


def test_what_is_unset_is_nan_and_the_speed_of_sound_is_that_of_base_types() -> None:
    sonar = Sonar()
    unset = [sonar.bin_duration, sonar.beam_width, sonar.beam_height, *sonar.sensor_position, *sonar.sensor_orientation]
    assert all(math.isnan(value) for value in unset)
    assert (sonar.time, sonar.speed_of_sound, sonar.bins.size, sonar.timestamps.size) == (0, 1497.0, 0, 0)


def test_two_samples_share_no_array() -> None:
    first, second = Sonar(), Sonar()
    first.sensor_position[0] = 1.0
    assert math.isnan(second.sensor_position[0])


def test_bin_duration_is_one_way_so_a_bin_is_as_long_as_sound_goes_in_it() -> None:
    # 30 m in 500 bins at 1500 m/s: 0.06 m take 40 us one way; two-way it would be 80.
    sonar = an_image(4, 500, bin_duration=40e-6, speed_of_sound=1500.0)
    assert sonar.bin_length == pytest.approx(0.06, rel=1e-15)
    ranges = sonar.bin_ranges()
    # Middles: the first half a bin from the sonar, the last half a bin before the range. Rounding of doubles only.
    np.testing.assert_allclose(ranges[[0, -1]], [0.03, 29.97], rtol=1e-14)
    assert ranges.shape == (500,)


def test_bin_duration_is_not_rounded_to_microseconds() -> None:
    # 20 m in 1000 bins: 13.36 us. Whole microseconds made the original's ranges 2.7 % short.
    sonar = an_image(4, 1000, bin_duration=20 / 1000 / 1497)
    assert sonar.bin_ranges()[-1] == pytest.approx(20 - 0.01, rel=1e-12)


def test_a_whole_image_is_valid() -> None:
    an_image().validate()
    an_image(timestamps=np.arange(4)).validate()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"bins": np.zeros((5, 4), np.float32)}, r"bins must be \(4, 5\) beams x bins, got \(5, 4\)"),
        ({"bins": np.zeros(20, np.float32)}, r"bins must be \(4, 5\) beams x bins, got \(20,\)"),
        ({"beam_count": 3}, r"bins must be \(3, 5\)"),
        ({"bearings": np.zeros(3)}, r"bearings must hold 4 beam centres, got \(3,\)"),
        ({"timestamps": np.arange(3)}, r"timestamps must be empty or one per beam, got \(3,\)"),
        ({"bin_duration": 0.0}, "bin_duration must be above 0, got 0"),
        ({"bin_duration": math.nan}, "bin_duration must be above 0, got nan"),
        ({"speed_of_sound": -1.0}, "speed_of_sound must be above 0, got -1"),
    ],
)
def test_what_does_not_fit_is_named(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        an_image(**changes).validate()
