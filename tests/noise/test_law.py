"""The laws against closed forms: normal distribution functions, the exponential, Rayleigh's law, moments of gamma."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sonar_component.noise.law import REACH, gamma, normal, rayleigh

# Equally probable classes of a standard normal number, by their middle: a quadrature for moments.
_COUNT = 20_000


@pytest.fixture(scope="module")
def z() -> np.ndarray:
    from statistics import NormalDist

    return np.array([NormalDist().inv_cdf((i + 0.5) / _COUNT) for i in range(_COUNT)])


def test_a_normal_law_is_a_line_that_is_cut_at_zero() -> None:
    law = normal(0.4, 0.15)
    assert np.allclose(law.factors(np.array([-4.0, -1.0, 0.0, 2.0])), [0.0, 0.25, 0.4, 0.7], atol=1e-12)


def test_a_folded_law_mirrors_what_would_be_negative() -> None:
    law = normal(0.95, 0.30, folded=True)
    assert np.allclose(law.factors(np.array([-4.0, 0.0, 1.0])), [0.25, 0.95, 1.25], atol=1e-12)


def test_one_look_of_intensity_is_exponential(z: np.ndarray) -> None:
    # Quantile of the exponential law at probability P: -ln(1 - P).
    upper = np.array([0.5 * math.erfc(v / math.sqrt(2)) for v in z])
    inside = np.abs(z) < 3
    # The polynomial is off by 1e-3 at most at REACH; the greatest quantile here is 6.6.
    assert np.abs(gamma(1).factors(z)[inside] + np.log(upper[inside])).max() < 2e-3


def test_one_look_of_amplitude_is_rayleigh(z: np.ndarray) -> None:
    upper = np.array([0.5 * math.erfc(v / math.sqrt(2)) for v in z])
    truth = np.sqrt(-np.log(upper)) / (math.sqrt(math.pi) / 2)  # scaled to mean 1
    inside = np.abs(z) < 3
    assert np.abs(rayleigh(1).factors(z)[inside] - truth[inside]).max() < 3e-3  # as above


@pytest.mark.parametrize("looks", [1.0, 1.7, 4.0, 8.0, 100.0])
def test_intensity_of_l_looks_has_mean_one_contrast_and_skewness_of_gamma(looks: float, z: np.ndarray) -> None:
    x = gamma(looks).factors(z)
    spread = x - x.mean()
    # Classes of 1 / 20 000: the tail's last class lacks 1e-3 of the second and 1e-2 of the third moment of an
    # exponential law, less for more looks.
    assert x.mean() == pytest.approx(1.0, abs=1e-3)
    assert x.std() / x.mean() == pytest.approx(looks**-0.5, rel=2e-3)
    assert (spread**3).mean() / x.std() ** 3 == pytest.approx(2 * looks**-0.5, rel=1.5e-2)


def test_every_law_is_skewed_to_low_values_or_symmetric(z: np.ndarray) -> None:
    for law in (gamma(1), gamma(8), rayleigh(1)):
        x = law.factors(z)
        assert np.median(x) < x.mean()


def test_gamma_never_falls_and_is_never_negative() -> None:
    z = np.linspace(-REACH - 1, REACH + 1, 4001)
    for looks in (1, 1.5, 3, 8, 1000):
        x = gamma(looks).factors(z)
        assert (x >= 0).all()
        assert (np.diff(x) >= -1e-6).all()
