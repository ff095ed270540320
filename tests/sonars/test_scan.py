"""The full scan that collects one-beam samples."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sonar_component.samples import Sonar
from sonar_component.sonars.scan import Scan
from sonar_component.sonars.scan_head import ScanHead
from sonar_component.sonars.scanning_settings import ScanningSettings


def beam(bearing: float, value: float, time: int, bin_count: int = 4) -> Sonar:
    bins = np.full((1, bin_count), value, np.float32)
    return Sonar(
        time=time, bin_duration=1e-4, beam_width=0.05, beam_height=0.6, bearings=np.array([bearing]),
        bin_count=bin_count, beam_count=1, bins=bins,
    )  # fmt: skip


def turn(scan: Scan, head: ScanHead, pings: int, first_value: float) -> None:
    for number in range(pings):
        scan.add(head.place, beam(head.bearing, first_value + number, 1000 + int(first_value) + number))
        head.advance()


def test_a_turn_fills_it_and_the_next_turn_overwrites_beam_by_beam() -> None:
    head = ScanHead(ScanningSettings(motor_step=math.radians(90)))
    scan = Scan(head.bearings(), math.radians(90))
    turn(scan, head, 3, 0)
    assert scan.filled == 0.75
    turn(scan, head, 3, 3)
    whole = scan.sample()
    whole.validate()
    # Looked at 0, 90, 180, -90, 0, 90 deg; leftmost beam first.
    assert np.degrees(whole.bearings).round(6).tolist() == [90, 0, -90, -180]
    assert whole.bins[:, 0].tolist() == [5, 4, 3, 2]
    assert whole.timestamps.tolist() == [1005, 1004, 1003, 1002]
    assert whole.beam_width == pytest.approx(2 * math.pi)


def test_places_not_heard_yet_are_unknown() -> None:
    head = ScanHead(ScanningSettings(motor_step=math.radians(90)))
    scan = Scan(head.bearings(), math.radians(90))
    turn(scan, head, 1, 0)
    whole = scan.sample()
    assert np.isnan(whole.bins).all(axis=1).tolist() == [True, False, True, True]
    assert (whole.timestamps == 0).tolist() == [True, False, True, True]


def test_a_turn_that_its_step_does_not_divide_keeps_the_bearing_of_each_beam() -> None:
    head = ScanHead(ScanningSettings(motor_step=math.radians(80)))
    scan = Scan(head.bearings(), math.radians(80))
    turn(scan, head, 9, 0)
    whole = scan.sample()
    assert (np.diff(whole.bearings) < 0).all()
    # 0 80 160 -120 -40 40 120 -160 -80: the last in each of the five places from -180 deg on.
    assert np.degrees(whole.bearings).round(6).tolist() == [160, 120, 40, -80, -160]


def test_a_sector_through_180_degrees_stays_in_one_piece() -> None:
    chosen = ScanningSettings.model_validate(
        {"continuous": False, "left_limit": "170 deg", "right_limit": "-170 deg", "motor_step": "10 deg"}
    )
    head = ScanHead(chosen)
    scan = Scan(head.bearings(), chosen.motor_step)
    turn(scan, head, 3, 0)
    assert np.degrees(scan.sample().bearings).round(6).tolist() == [190, 180, 170]


def test_another_number_of_bins_begins_anew_and_an_empty_scan_says_so() -> None:
    scan = Scan(np.array([0.0, 1.0]), 1.0)
    with pytest.raises(ValueError, match="no beam yet"):
        scan.sample()
    scan.add(0, beam(0.0, 1.0, 5))
    scan.add(1, beam(1.0, 2.0, 6, bin_count=7))
    assert np.isnan(scan.sample().bins[1]).all()
    assert scan.filled == 0.5
