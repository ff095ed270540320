"""Absorption against published values and against its own limits."""

from __future__ import annotations

import math

import pytest

from sonar_component.acoustics.absorption import absorption, nepers_per_metre

ZERO = 273.15  # [K]


@pytest.mark.parametrize(
    ("case", "decibels", "nepers"),
    [
        # Frequency [Hz], temperature [K], salinity [ppt], pH, depth [m]; worked by hand from the formula, six digits.
        ((700e3, 20 + ZERO, 35, 8.1, 1), 214.642, 0.024712),
        ((300e3, 25 + ZERO, 0, 8.0, 2), 17.469, 0.002011),
    ],
)
def test_it_gives_the_values_worked_by_hand(case: tuple[float, ...], decibels: float, nepers: float) -> None:
    got = absorption(*case)
    assert got == pytest.approx(decibels, abs=5e-4)  # half a unit of the last digit given
    assert nepers_per_metre(got) == pytest.approx(nepers, abs=5e-7)


def test_it_is_what_the_original_simulator_s_own_test_expects() -> None:
    # Its test allows 3 %.
    got = nepers_per_metre(absorption(700e3, 20 + ZERO, 35, 8.1, 1))
    assert got == pytest.approx(0.0247, rel=0.03)


def test_fresh_water_has_only_the_water_term() -> None:
    f, T, z = 500.0, 15.0, 10.0  # [kHz], [degC], [m]
    water = 0.00049 * f**2 * math.exp(-(T / 27 + z / 17e3))
    # With no salt the boric acid relaxes at 0 Hz, so its term is 0 / f**2.
    assert absorption(f * 1e3, T + ZERO, 0, 8, z) == pytest.approx(water, rel=1e-12)


def test_absorption_grows_with_frequency_and_salt_and_falls_with_depth() -> None:
    base = absorption(675e3, 283.15, 35, 8, 0)
    assert absorption(1000e3, 283.15, 35, 8, 0) > base
    assert absorption(675e3, 283.15, 40, 8, 0) > base
    assert absorption(675e3, 283.15, 35, 8, 3000) < base


def test_a_decibel_is_a_ninth_of_a_neper() -> None:
    # exp(-n) = 10 ** (-dB / 20)
    assert math.exp(-nepers_per_metre(20e3)) == pytest.approx(0.1, rel=1e-12)
