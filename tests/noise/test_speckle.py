"""Speckle by its statistics. Tolerances are five standard errors, from the sample's size and its correlation."""

from __future__ import annotations

import math
from statistics import NormalDist

import numpy as np
import pytest
from pydantic import ValidationError

from sonar_component.noise import Speckle, SpeckleProperties
from sonar_component.noise.properties import PRESETS

BEAMS, BINS = 256, 500
N = BEAMS * BINS
SIGMAS = 5.0  # a fair test then fails once in two million


def noise(preset: object, pings: int = 1, level: float = 1.0, seed: int = 3) -> np.ndarray:
    """Factors of some pings on a flat image, (pings, beams, bins) float64."""
    speckle = Speckle(SpeckleProperties.model_validate(preset))
    rng = np.random.default_rng(seed)
    images = [speckle.apply(np.full((BEAMS, BINS), level, np.float32), rng) for _ in range(pings)]
    return np.array(images, np.float64) / level


def lag(image: np.ndarray, axis: int, distance: int = 1) -> float:
    """Correlation of neighbours along an axis of (beams, bins)."""
    a = np.moveaxis(image - image.mean(), axis, 0)
    return float((a[:-distance] * a[distance:]).mean() / (a * a).mean())


def detrended(image: np.ndarray, size: int = 31) -> np.ndarray:
    """An image over its own mean within size x size, as the real frames were measured; edges left out."""
    sums = np.pad(image, ((1, 0), (1, 0))).cumsum(0).cumsum(1)
    mean = (sums[size:, size:] - sums[:-size, size:] - sums[size:, :-size] + sums[:-size, :-size]) / size**2
    half = size // 2
    return image[half:-half, half:-half] / mean


def distance_to(image: np.ndarray, distribution: object) -> float:
    """Greatest difference between the empirical distribution and a distribution function."""
    x = np.sort(image.ravel())
    return float(np.abs((np.arange(x.size) + 0.5) / x.size - distribution(x)).max())  # type: ignore[operator]


KS = 2.2 / math.sqrt(N)  # Kolmogorov's statistic, exceeded once in 8 000 fair samples


def test_the_paper_s_noise_is_normal_with_mean_0_4_and_never_negative() -> None:
    n = noise("cerqueira-2017")[0]
    assert n.min() >= 0
    assert n.mean() == pytest.approx(0.4, abs=SIGMAS * 0.15 / math.sqrt(N))
    assert n.std() == pytest.approx(0.15, abs=SIGMAS * 0.15 / math.sqrt(2 * N))
    cdf = np.vectorize(NormalDist(0.4, 0.15).cdf)
    above = n[n > 0]
    assert distance_to(above, cdf) < KS + NormalDist(0.4, 0.15).cdf(0)  # what was cut at 0 is missing below


def test_the_later_noise_folds_and_lights_a_floor() -> None:
    n = noise("cerqueira-2020")[0]
    assert n.mean() == pytest.approx(0.95, abs=SIGMAS * 0.30 / math.sqrt(N) + 5e-4)  # folding adds 2.4e-4
    dark = noise("cerqueira-2020", level=1e-3)[0] * 1e-3
    assert dark.mean() == pytest.approx(0.03 * 0.95, rel=0.01)


def test_the_2017_noise_leaves_black_black() -> None:
    speckle = Speckle(SpeckleProperties())
    assert not speckle.apply(np.zeros((4, 100), np.float32), np.random.default_rng(0)).any()


def test_one_look_follows_the_exponential_law() -> None:
    n = noise("gamma")[0]
    # The law's polynomial is off by less than 1e-4 in probability.
    assert distance_to(n, lambda x: 1 - np.exp(-x)) < KS + 1e-4


def test_one_look_of_amplitude_follows_rayleigh() -> None:
    n = noise("rayleigh")[0]
    assert distance_to(n, lambda x: 1 - np.exp(-((x * math.sqrt(math.pi) / 2) ** 2))) < KS + 1e-4


@pytest.mark.parametrize("preset", ["cerqueira-2017", "cerqueira-2020", "gamma", "rayleigh"])
def test_the_originals_are_fresh_in_every_bin_and_ping(preset: str) -> None:
    a, b = noise(preset, pings=2)
    bound = SIGMAS / math.sqrt(N)
    assert abs(lag(a, 0)) < bound
    assert abs(lag(a, 1)) < bound
    assert abs(np.corrcoef(a.ravel(), b.ravel())[0, 1]) < bound


def test_correlation_falls_by_e_over_the_correlation_length() -> None:
    wanted = {"law": "normal", "mean": 2.0, "deviation": 0.1, "beam_correlation_length": 4, "bin_correlation_length": 2}
    n = noise(wanted, pings=8)
    # Effective sample: every correlated patch counts once, (1 + c) / (1 - c) = 8 beams and 4 bins long.
    bound = SIGMAS / math.sqrt(8 * N / 32)
    for axis, length in ((0, 4), (1, 2)):
        measured = np.mean([lag(image, axis, length) for image in n])
        assert measured == pytest.approx(math.exp(-1), abs=bound)
    assert n.std() == pytest.approx(0.1, rel=bound)


def test_correlation_is_the_same_at_the_edges_as_inside() -> None:
    wanted = {"law": "normal", "mean": 2.0, "deviation": 0.1, "beam_correlation_length": 4, "bin_correlation_length": 4}
    n = noise(wanted, pings=40) - 2.0
    bound = SIGMAS / math.sqrt(2 * 40 * BEAMS / 8)  # of a deviation; a patch counts once
    assert n[:, :, 0].std() == pytest.approx(0.1, rel=bound)
    bound = SIGMAS / math.sqrt(2 * 40 * BINS / 8)
    assert n[:, 0].std() == pytest.approx(0.1, rel=bound)
    assert n[:, -1].std() == pytest.approx(0.1, rel=bound)


def test_the_oculus_preset_has_the_statistics_of_a_real_frame() -> None:
    # peers' measurement of three pings, each bin over its 31 x 31 mean; the issue asks for each within 0.1.
    a, b, c = (detrended(image) for image in noise("oculus-like", pings=3))
    for image in (a, b, c):
        assert image.std() / image.mean() == pytest.approx(0.35, abs=0.03)
        assert lag(image, 0) == pytest.approx(0.68, abs=0.03)
        assert lag(image, 1) == pytest.approx(0.29, abs=0.03)
        # The sizes of the lags that the filter was not set to.
        assert lag(image, 0, 2) == pytest.approx(0.40, abs=0.1)
        assert lag(image, 1, 2) == pytest.approx(0.14, abs=0.1)
    for first, second in ((a, b), (b, c), (a, c)):
        assert np.corrcoef(first.ravel(), second.ravel())[0, 1] == pytest.approx(0.6, abs=0.05)


@pytest.mark.parametrize("stays", [0.0, 0.25, 0.6, 0.9])
def test_pings_from_one_place_are_as_alike_as_asked_however_far_apart(stays: float) -> None:
    wanted = {"law": "normal", "mean": 2.0, "deviation": 0.1, "ping_correlation": stays}
    n = noise(wanted, pings=6).reshape(6, -1)
    measured = np.corrcoef(n)
    for first, second in ((0, 1), (1, 2), (0, 5)):
        assert measured[first, second] == pytest.approx(stays, abs=SIGMAS / math.sqrt(N))


def test_frozen_noise_does_not_change_at_all() -> None:
    a, b = noise({"preset": "oculus-like", "ping_correlation": 1}, pings=2)
    assert (a == b).all()


def test_a_sonar_that_moves_sees_other_speckle() -> None:
    wanted = {"law": "normal", "mean": 2.0, "deviation": 0.1, "ping_correlation": 1.0}
    speckle = Speckle(SpeckleProperties.model_validate(wanted))
    rng = np.random.default_rng(5)
    images = [speckle.apply(np.ones((BEAMS, BINS), np.float32), rng, stirred).ravel() for stirred in (0.0, 1.0, 30.0)]
    measured = np.corrcoef(images)
    bound = SIGMAS / math.sqrt(N)
    assert measured[0, 1] == pytest.approx(math.exp(-1), abs=bound)
    assert abs(measured[0, 2]) < bound
    assert all(image.std() == pytest.approx(0.1, rel=bound) for image in images)


def test_stirring_while_part_is_fresh_keeps_the_spread() -> None:
    wanted = {"law": "normal", "mean": 2.0, "deviation": 0.1, "ping_correlation": 0.5}
    speckle = Speckle(SpeckleProperties.model_validate(wanted))
    rng = np.random.default_rng(5)
    for stirred in (0.0, 0.3, 0.3, 2.0):
        image = speckle.apply(np.ones((BEAMS, BINS), np.float32), rng, stirred)
        assert image.std() == pytest.approx(0.1, rel=SIGMAS / math.sqrt(2 * N))


def test_the_decorrelation_length_and_angle_set_the_pace() -> None:
    wanted = {"decorrelation_length": "10 cm", "decorrelation_angle": "2 deg"}
    speckle = Speckle(SpeckleProperties.model_validate(wanted))
    assert speckle.stirring(0.05, math.radians(1)) == pytest.approx(1.0)


def test_the_same_seed_gives_the_same_bits_and_another_one_does_not() -> None:
    first, again, other = (noise("oculus-like", pings=3, seed=s) for s in (7, 7, 8))
    assert (first == again).all()
    assert (first != other).mean() > 0.99


def test_a_scanning_head_correlates_neighbouring_pings_and_keeps_each_place_for_the_next_turn() -> None:
    wanted = {"law": "normal", "mean": 2.0, "deviation": 0.1, "beam_correlation_length": 2, "ping_correlation": 0.6}
    speckle = Speckle(SpeckleProperties.model_validate(wanted))
    rng = np.random.default_rng(9)
    places = 200
    turns = [
        np.concatenate([speckle.apply_beam(np.ones((1, BINS), np.float32), p, places, rng) for p in range(places)])
        for _ in range(3)
    ]
    bound = SIGMAS / math.sqrt(places * BINS / 4)  # (1 + c) / (1 - c) is 4 for a length of two beams
    assert np.corrcoef(turns[1].ravel(), turns[2].ravel())[0, 1] == pytest.approx(0.6, abs=bound)
    assert np.corrcoef(turns[0].ravel(), turns[2].ravel())[0, 1] == pytest.approx(0.6, abs=bound)
    assert lag(turns[2] - 2.0, 0) == pytest.approx(math.exp(-0.5), abs=bound)
    assert turns[2].std() == pytest.approx(0.1, rel=bound)


def test_any_number_of_beams_and_bins_will_do() -> None:
    for shape in ((1, 1), (2, 3), (5, 1), (7, 513), (4, 7)):
        speckle = Speckle(SpeckleProperties.model_validate("oculus-like"))
        rng = np.random.default_rng(0)
        for _ in range(2):
            assert np.isfinite(speckle.apply(np.ones(shape, np.float32), rng)).all()


def test_a_change_of_shape_begins_anew() -> None:
    speckle = Speckle(SpeckleProperties.model_validate("oculus-like"))
    rng = np.random.default_rng(0)
    speckle.apply(np.ones((8, 100), np.float32), rng)
    assert speckle.apply(np.ones((9, 100), np.float32), rng).shape == (9, 100)


def test_the_presets_are_valid_and_named_alone_will_do() -> None:
    for name in PRESETS:
        assert SpeckleProperties.model_validate(name).preset == name


def test_given_numbers_win_over_the_preset() -> None:
    chosen = SpeckleProperties.model_validate({"preset": "oculus-like", "looks": 3})
    assert (chosen.looks, chosen.ping_correlation) == (3, 0.62)
    assert SpeckleProperties.model_validate(chosen.model_dump()) == chosen


@pytest.mark.parametrize(
    ("wanted", "words"),
    [
        ({"law": "gamma", "looks": 4, "deviation": 0.1}, "law gamma has no deviation; it has looks"),
        ({"law": "gamma"}, "law gamma needs looks"),
        ({"looks": 4}, "law normal has no looks"),
        ({"preset": "gamma", "looks": 0.2}, "greater than or equal to 1"),
        ({"ping_correlation": 1.2}, "less than or equal to 1"),
        ({"bin_correlation_length": "2 m"}, "must be of ratio"),
        ({"preset": "oculus"}, "oculus-like"),
    ],
)
def test_numbers_that_do_not_fit_are_refused_in_words(wanted: object, words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        SpeckleProperties.model_validate(wanted)
