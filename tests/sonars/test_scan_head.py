"""Where the head looks: sectors of every kind, walked by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from sonar_component.sonars.scan_head import ScanHead, wrapped
from sonar_component.sonars.scanning_settings import ScanningSettings


def settings(left: float, right: float, step: float, **more: Any) -> ScanningSettings:
    """Back and forth between limits, all in degrees."""
    sector = {"left_limit": f"{left} deg", "right_limit": f"{right} deg", "motor_step": f"{step} deg"}
    return ScanningSettings.model_validate({"continuous": False, **sector, **more})


def walk(chosen: ScanningSettings, pings: int) -> list[float]:
    """Bearings of the first pings [deg]."""
    head, seen = ScanHead(chosen), []
    for _ in range(pings):
        seen.append(round(math.degrees(head.bearing), 6))
        head.advance()
    return seen


def test_it_goes_back_and_forth_and_measures_each_limit_once() -> None:
    assert walk(settings(-20, 20, 10), 10) == [-20, -10, 0, 10, 20, 10, 0, -10, -20, -10]


def test_a_step_that_does_not_divide_the_sector_is_shortened_at_its_end() -> None:
    assert walk(settings(-10, 15, 10), 8) == [-10, 0, 10, 15, 10, 0, -10, 0]


def test_left_above_right_is_a_sector_through_180_degrees() -> None:
    assert walk(settings(170, -160, 10), 6) == [170, 180, -170, -160, -170, 180]


def test_a_sector_that_ends_at_180_degrees_does_not_cross_it() -> None:
    assert walk(settings(160, 180, 10), 5) == [160, 170, 180, 170, 160]


def test_it_starts_where_it_is_told_and_steps_from_there() -> None:
    assert walk(settings(-10, 10, 4, start_bearing="3 deg"), 8) == [3, 7, 10, 7, 3, -1, -5, -9]
    assert walk(settings(-10, 10, 4, start_bearing="3 deg"), 10)[-1] == -9  # turned back on the limit, -10
    assert walk(settings(-10, 10, 4, start_bearing="3 deg"), 9)[-1] == -10


def test_a_full_turn_back_and_forth_does_not_measure_180_degrees_twice() -> None:
    seen = walk(settings(-180, 180, 90), 8)
    assert seen == [180, -90, 0, 90, 0, -90, 180, -90]


def test_turning_for_ever_ignores_the_limits_and_wraps() -> None:
    chosen = settings(-10, 10, 90, continuous=True, start_bearing="45 deg")
    assert walk(chosen, 6) == [45, 135, -135, -45, 45, 135]


def test_turning_for_ever_by_a_step_that_does_not_divide_the_turn_goes_on_like_a_motor() -> None:
    chosen = settings(-180, 180, 80, continuous=True)
    assert walk(chosen, 6) == [0, 80, 160, -120, -40, 40]


def test_a_million_steps_leave_no_rounding_behind() -> None:
    head = ScanHead(ScanningSettings(motor_step=math.radians(0.9)))
    for _ in range(400 * 50):
        head.advance()
    assert abs(head.bearing) < 1e-9  # radians; a sum of 20 000 steps would be off by more


def test_the_end_of_a_scan_is_said_at_limits_and_after_turns() -> None:
    head = ScanHead(settings(-20, 20, 10))
    assert [head.advance() for _ in range(9)] == [False] * 4 + [True] + [False] * 3 + [True]
    head = ScanHead(ScanningSettings(motor_step=math.radians(90)))
    assert [head.advance() for _ in range(9)] == [False] * 3 + [True] + [False] * 3 + [True, False]


def test_when_settings_change_the_head_goes_to_the_nearest_place() -> None:
    head = ScanHead(settings(-60, 60, 10))
    head.look_at(math.radians(17))
    assert math.degrees(head.bearing) == pytest.approx(20)


@pytest.mark.parametrize("continuous", [True, False])
def test_skipping_pings_is_as_good_as_walking_them(continuous: bool) -> None:
    chosen = settings(-20, 25, 10, continuous=continuous)
    for pings in (0, 1, 7, 40, 1001):
        walked, skipped = ScanHead(chosen), ScanHead(chosen)
        for _ in range(pings):
            walked.advance()
        skipped.skip(pings)
        assert skipped.bearing == pytest.approx(walked.bearing)
        walked.advance()
        skipped.advance()
        assert skipped.bearing == pytest.approx(walked.bearing)


@given(
    left=st.integers(-180, 180), right=st.integers(-180, 180), step=st.floats(0.45, 90),
    share=st.none() | st.floats(0, 1), continuous=st.booleans(),
)  # fmt: skip
def test_every_walk_stays_in_the_sector_and_visits_all_of_it(
    left: int, right: int, step: float, share: float | None, continuous: bool
) -> None:
    try:
        chosen = settings(left, right, step, continuous=continuous)
    except ValidationError:
        return
    if share is not None:
        start = wrapped(chosen.left_limit + share * chosen.sector)
        chosen = ScanningSettings.model_validate({**chosen.model_dump(), "start_bearing": start})
    head = ScanHead(chosen)
    assert wrapped(head.bearing) == pytest.approx(head.bearing)
    places, before = set(), None
    for _ in range(2 * head.places):
        if not continuous:
            beyond = (head.bearing - chosen.left_limit + 1e-9) % (2 * math.pi)
            assert beyond <= chosen.sector + 2e-9
        assert 0 <= head.place < head.places
        places.add(head.place)
        if before is not None:
            moved = abs((head.bearing - before + math.pi) % (2 * math.pi) - math.pi)
            assert 0 < moved <= chosen.motor_step + 1e-9 or head.places == 1
        before = head.bearing
        head.advance()
    # A turn whose step does not divide it comes by every place in the long run only.
    assert len(places) == head.places or continuous
    assert (np.diff(head.bearings()) > 0).all()


@pytest.mark.parametrize(
    ("left", "right", "step", "more", "words"),
    [
        (10, 10, 1, {}, "left_limit and right_limit must differ.*10 deg and 10 deg"),
        (-180, -180, 1, {}, "must differ"),
        (180, -180, 1, {}, "must differ"),
        (-10, 10, 0, {}, r"motor_step must be 0.01 deg to 20 deg \(the width of the sector\), got 0 deg"),
        (-10, 10, -1, {}, "motor_step must be"),
        (-10, 10, 21, {}, r"motor_step must be.*20 deg .*, got 21 deg"),
        (-10, 10, 1, {"start_bearing": "30 deg"}, "start_bearing must be in the sector.*got 30 deg"),
        (-200, 10, 1, {}, "must be -180 deg to 180 deg, got -200 deg"),
        (-180, 180, 1, {"start_bearing": "190 deg"}, "must be -180 deg to 180 deg, got 190 deg"),
        (-10, 10, 400, {"continuous": True}, "0.01 deg to 90 deg, got 400 deg"),
        (-180, 180, 1, {"motor_step": 1.8}, "got 103.132 deg; a number without a unit is in rad"),
    ],
)
def test_a_head_that_cannot_move_is_refused_in_words(
    left: float, right: float, step: float, more: dict[str, Any], words: str
) -> None:
    with pytest.raises(ValidationError, match=words):
        settings(left, right, step, **more)


def test_a_ping_takes_its_listening_its_bins_and_its_step_but_never_less_than_the_device() -> None:
    chosen = ScanningSettings(
        range=30.0, speed_of_sound=1500.0, bin_count=500, bin_time=1e-5, motor_step=0.02, head_speed=2.0
    )
    assert chosen.ping_period == pytest.approx(0.040 + 0.005 + 0.010)
    chosen.min_ping_period = 0.1
    assert chosen.ping_period == 0.1
