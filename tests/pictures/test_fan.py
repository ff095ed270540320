"""The fan picture against a plain loop over pixels and against geometry on paper."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sonar_component.pictures.fan import beam_edges, fan_map
from sonar_component.samples import Sonar


def make_sonar(bearings_deg, bin_count=40, reach=20.0, bins=None, beam_width_deg=float("nan")):
    bearings = np.radians(np.asarray(bearings_deg, float))
    if bins is None:
        bins = np.arange(bearings.size * bin_count, dtype=np.float32).reshape(bearings.size, bin_count)
    return Sonar(
        time=1,
        bin_duration=reach / bin_count / 1500.0,
        beam_width=math.radians(beam_width_deg),
        bearings=bearings,
        speed_of_sound=1500.0,
        bin_count=bin_count,
        beam_count=bearings.size,
        bins=bins.astype(np.float32),
    )


def cell_by_hand(sonar, x, y):
    """Beam and bin that hold a point: the nearest bearing, and the range divided by the bin's length."""
    bearing, distance = math.atan2(y, x), math.hypot(x, y)
    away = [abs(math.remainder(bearing - b, math.tau)) for b in sonar.bearings]
    return int(np.argmin(away)), int(distance // sonar.bin_length)


def pixel_position(table, row, column):
    left, right, bottom, top = table.extent
    rows, columns = table.index.shape
    return top - (row + 0.5) * (top - bottom) / rows, left - (column + 0.5) * (left - right) / columns


EQUAL_ANGLE = np.linspace(-58, 58, 30)
EQUAL_SINE = np.degrees(np.arcsin(np.linspace(-0.86, 0.86, 31)))
A_LIST = [-50, -31, -30, -12, 0, 3, 4, 20, 45, 70]
ALL_ROUND = np.arange(72) * 5.0 - 177.0


@pytest.mark.parametrize("bearings", [EQUAL_ANGLE, EQUAL_ANGLE[::-1], EQUAL_SINE, A_LIST, ALL_ROUND, ALL_ROUND + 180.0])
def test_every_pixel_inside_shows_the_cell_that_holds_its_centre(bearings):
    sonar = make_sonar(bearings)
    table = fan_map(sonar, size=90)
    for row, column in np.argwhere(table.inside):
        beam, bin_ = cell_by_hand(sonar, *pixel_position(table, row, column))
        assert table.index[row, column] == beam * sonar.bin_count + bin_


@pytest.mark.parametrize("bearings", [EQUAL_ANGLE, EQUAL_SINE, A_LIST, ALL_ROUND])
def test_the_fan_covers_its_sector_without_holes(bearings):
    sonar = make_sonar(bearings)
    table = fan_map(sonar, size=300)
    edges = beam_edges(np.sort(sonar.bearings))
    left, right, bottom, top = table.extent
    pixel_area = (left - right) * (top - bottom) / table.index.size
    sector = (edges[-1] - edges[0]) / 2 * 20.0**2
    # Only pixels cut by the outline can differ: the outline is under 2 reach + the arc long, so at 300 pixels a side
    # fewer than 1000 of about 40 000 are cut, and they are cut in both directions.
    assert table.inside.sum() * pixel_area == pytest.approx(sector, rel=0.01)


def test_a_target_at_plus_thirty_degrees_is_drawn_on_the_left_and_ahead_is_up():
    bins = np.zeros((121, 50), np.float32)
    bins[90, 40] = 1.0  # bearing +30 deg of -60..60, range 40.5 of 50
    sonar = make_sonar(np.arange(121) - 60.0, bin_count=50, reach=50.0, bins=bins)
    table = fan_map(sonar, size=400)
    rows, columns = np.nonzero(table.apply(bins) == 1.0)
    x, y = pixel_position(table, rows.mean(), columns.mean())
    pixel = (table.extent[0] - table.extent[1]) / table.index.shape[1]
    # The middle of the cell's pixels is off the cell's middle by less than a pixel.
    assert (x, y) == pytest.approx((40.5 * math.cos(math.radians(30)), 40.5 * math.sin(math.radians(30))), abs=pixel)
    assert columns.mean() < table.index.shape[1] / 2
    assert rows.mean() < table.index.shape[0] / 2


def test_beams_meet_midway_between_their_centres():
    assert beam_edges(np.array([0.0, 1.0, 3.0])) == pytest.approx([-0.5, 0.5, 2.0, 4.0])


def test_a_single_beam_is_as_wide_as_it_says():
    assert beam_edges(np.array([0.2]), 0.1) == pytest.approx([0.15, 0.25])


def test_a_full_turn_closes_midway_between_last_and_first_beam():
    edges = beam_edges(np.radians([-170.0, -60.0, 60.0, 178.0]))
    assert edges[-1] - edges[0] == pytest.approx(2 * np.pi)
    assert np.degrees(edges[-1]) == pytest.approx(184.0)


def test_nan_stays_nan_and_zero_stays_zero():
    bins = np.zeros((20, 30), np.float32)
    bins[:10] = np.nan
    sonar = make_sonar(np.linspace(-40, 40, 20), bin_count=30, bins=bins)
    table = fan_map(sonar, size=120)
    for interpolation in ("nearest", "linear"):
        picture = table.apply(sonar.bins, interpolation)
        beam = table.index // 30
        assert np.isnan(picture[table.inside & (beam < 10)]).all()
        assert (picture[table.inside & (beam >= 10)] == 0).all()
        assert np.isnan(picture[~table.inside]).all()


@pytest.mark.parametrize("direction", [1, -1])
def test_linear_interpolation_reproduces_a_ramp_in_range_and_bearing(direction):
    bearings = np.linspace(-45, 45, 31)[::direction]
    ramp = (np.arange(40)[None, :] * 2.0 + bearings[:, None] * 0.5).astype(np.float32)
    sonar = make_sonar(bearings, bins=ramp)
    table = fan_map(sonar, size=150)
    picture = table.apply(ramp, "linear")
    for row, column in np.argwhere(table.inside)[::37]:
        x, y = pixel_position(table, row, column)
        bin_, bearing = math.hypot(x, y) / sonar.bin_length - 0.5, math.degrees(math.atan2(y, x))
        if 0 < bin_ < 39 and abs(bearing) < 45:
            # A bilinear picture of a plane is that plane; float32 indices of 40 x 31 cells carry 6 digits.
            assert picture[row, column] == pytest.approx(bin_ * 2 + bearing * 0.5, abs=1e-3)


def test_the_same_geometry_is_computed_once():
    assert fan_map(make_sonar(EQUAL_ANGLE)) is fan_map(make_sonar(EQUAL_ANGLE))
    assert fan_map(make_sonar(EQUAL_ANGLE)) is not fan_map(make_sonar(EQUAL_ANGLE, reach=30.0))


def test_a_fan_that_cannot_be_drawn_says_why():
    sonar = make_sonar([0.0, float("nan"), 2.0])
    with pytest.raises(ValueError, match="bearings must be finite"):
        fan_map(sonar)
    with pytest.raises(ValueError, match="at least one beam"):
        fan_map(make_sonar([]))
