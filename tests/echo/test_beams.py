"""Bearing tables: sectors that tile the fan, and centres where a device has them."""

from __future__ import annotations

import numpy as np
import pytest

from sonar_component.echo.beams import BeamTable, equal_angle, equal_sine, from_list

NARROW, WIDE, HALF_TURN, ALMOST, FULL = np.radians([1.0, 130.0, 180.0, 359.0, 360.0])
TALL = np.radians(20.0)


def tiles_from_left_to_right(table: BeamTable) -> bool:
    return bool((table.right[:-1] == table.left[1:]).all() and (table.right < table.left).all())


@pytest.mark.parametrize("beams", [1, 2, 255, 700, 2048])
@pytest.mark.parametrize("width", [NARROW, WIDE, ALMOST, FULL])
def test_beams_of_equal_angle_tile_the_fan(beams: int, width: float) -> None:
    table = equal_angle(beams, width, TALL)
    assert tiles_from_left_to_right(table)
    assert (table.left[0], table.right[-1]) == (width / 2, -width / 2)
    np.testing.assert_allclose(table.left - table.right, width / beams, rtol=1e-11)  # rounding of float64 edges
    np.testing.assert_allclose(table.bearings, (table.left + table.right) / 2, atol=1e-15)


@pytest.mark.parametrize("width", [NARROW, WIDE, HALF_TURN])
def test_beams_of_equal_sine_have_equal_steps_in_the_sine(width: float) -> None:
    table = equal_sine(257, width, TALL)
    assert tiles_from_left_to_right(table)
    assert table.left[0] == pytest.approx(width / 2)
    step = 2 * np.sin(width / 2) / 257
    # arcsin near 90 deg keeps half of float64's digits of a sine's step.
    np.testing.assert_allclose(np.diff(np.sin(table.bearings)), -step, rtol=1e-9)
    assert table.bearings[128] == pytest.approx(0, abs=1e-15)
    np.testing.assert_allclose(table.bearings, -table.bearings[::-1], atol=1e-14)


def test_a_sine_does_not_tell_front_from_back() -> None:
    with pytest.raises(ValueError, match=r"beam_width of at most 180 deg, got 200 deg"):
        equal_sine(10, np.radians(200), TALL)


@pytest.mark.parametrize("order", [1, -1])
def test_edges_of_a_list_lie_midway_between_its_centres(order: int) -> None:
    centres = np.radians([30.0, 10.0, 5.0, -20.0])[::order]
    table = from_list(centres, TALL)
    np.testing.assert_array_equal(table.bearings, centres)
    np.testing.assert_allclose(np.degrees(table.left)[::order], [40.0, 20.0, 7.5, -7.5])
    np.testing.assert_allclose(np.degrees(table.right)[::order], [20.0, 7.5, -7.5, -32.5])


@pytest.mark.parametrize(
    ("centres", "message"),
    [
        ([0.1], "at least 2"),
        ([], "at least 2"),
        ([0.0, np.nan, 0.2], "finite"),
        ([0.0, 0.1, 0.1], "without a repeat"),
        ([0.0, 0.2, 0.1], "rise or fall"),
        (np.linspace(-3.2, 3.2, 20).tolist(), "at most 360 deg"),
    ],
)
def test_a_list_that_makes_no_fan_is_refused_with_the_reason(centres: list[float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        from_list(np.array(centres), TALL)


def test_the_solid_angle_is_that_of_the_sector_between_two_cones() -> None:
    table = equal_angle(7, WIDE, np.radians(60))
    elevation = np.linspace(-np.radians(30), np.radians(30), 20001)
    by_sum = np.trapezoid(np.cos(elevation), elevation) * WIDE / 7
    np.testing.assert_allclose(table.solid_angle, by_sum, rtol=1e-8)  # the trapezoid's own error, step^2 / 12


def test_a_full_turn_of_full_height_is_the_whole_sphere() -> None:
    assert equal_angle(16, FULL, np.pi).solid_angle.sum() == pytest.approx(4 * np.pi)


def test_turning_keeps_widths() -> None:
    table = equal_angle(5, WIDE, TALL).turned(2.0)
    assert table.bearings[2] == pytest.approx(2.0)
    np.testing.assert_allclose(table.left - table.right, WIDE / 5)
