"""Spreading and time-varying gain against their closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from sonar_component.acoustics.spreading import amplitude, spreading_loss, time_varying_gain


def test_spherical_spreading_takes_the_amplitude_down_by_the_square_of_the_range() -> None:
    ranges = np.array([1.0, 2.0, 10.0, 37.0])
    assert np.allclose(amplitude(-spreading_loss(ranges, 40)), ranges**-2.0, rtol=1e-12)


def test_cylindrical_spreading_takes_it_down_by_the_range() -> None:
    ranges = np.array([1.0, 3.0, 80.0])
    assert np.allclose(amplitude(-spreading_loss(ranges, 20)), 1 / ranges, rtol=1e-12)


def test_nothing_is_lost_or_added_within_a_metre() -> None:
    near = np.array([0.0, 0.01, 0.5, 1.0])
    assert not spreading_loss(near, 40).any()
    assert not time_varying_gain(near, 40, 0.2, 100).any()


def test_a_gain_of_the_same_law_undoes_the_losses() -> None:
    ranges, alpha = np.linspace(1.0, 60.0, 50), 0.07  # [m], [dB/m]
    losses = spreading_loss(ranges, 40) + 2 * alpha * (ranges - 1)
    assert np.allclose(time_varying_gain(ranges, 40, alpha, 1000), losses, atol=1e-12)


def test_the_amplifier_has_a_limit() -> None:
    gain = time_varying_gain(np.array([1.0, 10.0, 100.0, 1000.0]), 40, 0.1, 60)
    assert gain[0] == 0
    assert gain[1] == pytest.approx(41.8)
    assert list(gain[2:]) == [60, 60]
