"""A scanning sonar's turn: filling, overwriting, wrapping, and beginning anew."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sonar_component.pictures.sweep import SLOTS, Sweep, slot_bearings
from sonar_component.samples import Sonar


def beam(bearing_deg, value=1.0, bin_count=8, bin_duration=1e-4, width_deg=3.0):
    return Sonar(
        time=round(bearing_deg * 1000) + 10**6,
        bin_duration=bin_duration,
        beam_width=math.radians(width_deg),
        bearings=np.radians([float(bearing_deg)]),
        speed_of_sound=1500.0,
        bin_count=bin_count,
        beam_count=1,
        bins=np.full((1, bin_count), value, np.float32),
    )


@pytest.mark.parametrize("step", [0.45, 0.9, 1.0, 1.8, 2.5])
def test_a_whole_turn_fills_every_slot(step):
    sweep = Sweep()
    for i in range(math.ceil(360 / step) + 2):
        sweep.add(beam(-90 + i * step, value=i))
    assert not np.isnan(sweep.bins).any()
    held = np.degrees(np.abs(np.angle(np.exp(1j * (sweep.bearings - slot_bearings())))))
    # A slot's middle is nearest to the beam it holds: half a step, and half a slot because beams end on slot edges.
    # The wedge of the very first beam is as wide as the beam, and the turn's last beams have overwritten it.
    assert held.max() <= step / 2 + 0.225 + 1e-6


def test_a_second_turn_overwrites_the_first():
    sweep = Sweep()
    for value in (1.0, 2.0):
        for i in range(400):
            sweep.add(beam(i * 0.9, value))
    assert (sweep.bins == 2.0).all()


def test_slots_that_were_not_looked_at_are_nan():
    sweep = Sweep()
    changed = np.concatenate([sweep.add(beam(i * 0.9)) for i in range(-50, 51)])
    seen = ~np.isnan(sweep.bins[:, 0])
    assert set(np.flatnonzero(seen)) == set(changed)
    away = np.degrees(np.abs(np.angle(np.exp(1j * slot_bearings()))))
    assert not seen[away > 45 + 1.5].any()  # the last beam's middle, and half a beam for the first wedge
    assert seen[away < 45].all()


def test_a_head_that_steps_farther_than_its_beam_is_wide_leaves_gaps():
    sweep = Sweep()
    for i in range(36):
        sweep.add(beam(i * 10.0, width_deg=3.0))
    assert np.mean(~np.isnan(sweep.bins[:, 0])) == pytest.approx(0.3, abs=0.05)  # 3 of 10 deg; slots are 0.45 deg


def test_the_head_is_the_last_beam():
    sweep = Sweep()
    sweep.add(beam(10.0))
    sweep.add(beam(-20.0))
    assert math.degrees(sweep.head) == pytest.approx(-20.0)


@pytest.mark.parametrize("other", [{"bin_count": 9}, {"bin_duration": 2e-4}])
def test_a_beam_of_another_shape_begins_the_sweep_anew(other):
    sweep = Sweep()
    sweep.add(beam(0.0))
    assert sweep.restarts == 0
    sweep.add(beam(90.0, **other))
    assert sweep.restarts == 1
    assert np.isnan(sweep.bins[SLOTS // 2 :]).all()


def test_the_turn_is_an_image_of_its_own():
    sweep = Sweep()
    sweep.add(beam(30.0, value=5.0))
    image = sweep.as_sonar()
    image.validate()
    row = int(np.argmin(np.abs(image.bearings - math.radians(30))))
    assert (image.bins[row] == 5.0).all()


def test_an_empty_sweep_is_refused():
    with pytest.raises(ValueError, match="no beam yet"):
        Sweep().as_sonar()
