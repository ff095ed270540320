"""What happens between clean echoes and the sample: order, gain, and noise that leaves clean images alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sonar_component.sonars.receiver import Receiver, with_gain
from sonar_component.sonars.settings import ForwardLookingSettings

HERE = np.eye(4)
OFF_AXIS = {"range": 20.0, "bin_count": 200, "beam_count": 16}


def receiver(**values: Any) -> Receiver:
    return Receiver(ForwardLookingSettings.model_validate(OFF_AXIS | values))


def image(level: float = 0.25) -> np.ndarray:
    return np.full((16, 200), level, np.float32)


def test_a_gain_of_a_half_changes_no_bit_and_others_scale_up_to_full_scale() -> None:
    echoes = np.linspace(0, 1, 100, dtype=np.float32).reshape(1, -1)
    assert (with_gain(echoes.copy(), 0.5) == echoes).all()
    assert (with_gain(echoes.copy(), 0.25) == echoes / 2).all()
    assert (with_gain(echoes.copy(), 1.0) == np.minimum(2 * echoes, 1)).all()
    assert not with_gain(echoes.copy(), 0.0).any()


def test_without_noise_losses_and_gain_the_echoes_pass_bit_by_bit() -> None:
    echoes = np.random.default_rng(0).random((16, 200), np.float32)
    assert (receiver().fan(echoes.copy(), HERE, np.random.default_rng(1)) == echoes).all()
    off = receiver(enable_speckle_noise=False, speckle_properties="gamma")
    assert (off.fan(echoes.copy(), HERE, np.random.default_rng(1)) == echoes).all()
    on = receiver(enable_speckle_noise=True, speckle_properties="gamma")
    assert (on.fan(echoes.copy(), HERE, None) == echoes).all()


def test_noise_enters_before_the_time_varying_gain_which_raises_its_floor() -> None:
    tvg = {"spreading": "40 dB", "limit": "30 dB"}
    noisy = receiver(enable_speckle_noise=True, speckle_properties="cerqueira-2020", time_varying_gain=tvg)
    dark = noisy.fan(image(0.0), HERE, np.random.default_rng(0))
    near, far = dark[:, :5].mean(), dark[:, 100:].mean()
    # The floor of 0.03 times 0.95; 30 dB are a factor of 31.6, which lifts most of it to full scale.
    assert near == pytest.approx(0.03 * 0.95, rel=0.2)
    assert far > 0.7


def test_a_scene_seen_from_one_place_keeps_its_speckle_and_from_another_it_does_not() -> None:
    frozen = {"preset": "oculus-like", "ping_correlation": 1}
    still = receiver(enable_speckle_noise=True, speckle_properties=frozen)
    rng = np.random.default_rng(0)
    first, second = (still.fan(image(), HERE, rng) for _ in range(2))
    assert (first == second).all()
    moved = HERE.copy()
    moved[0, 3] = 1.0  # a metre, twenty decorrelation lengths
    third = still.fan(image(), moved, rng)
    # 3200 bins, correlated over about ten: five standard errors of a correlation are 0.28.
    assert abs(np.corrcoef(first.ravel(), third.ravel())[0, 1]) < 0.28


def test_speckle_goes_on_through_a_change_of_gain() -> None:
    frozen = {"preset": "oculus-like", "ping_correlation": 1}
    settings = ForwardLookingSettings.model_validate(
        {**OFF_AXIS, "enable_speckle_noise": True, "speckle_properties": frozen}
    )
    still = Receiver(settings)
    rng = np.random.default_rng(0)
    first = still.fan(image(), HERE, rng)
    still.adopt(settings.model_copy(update={"gain": 0.25}))
    assert (still.fan(image(), HERE, rng) == np.float32(0.5) * first).mean() > 0.9  # the rest was clipped before
