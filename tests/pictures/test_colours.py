"""Tones and colour maps, by their definition."""

from __future__ import annotations

import numpy as np
import pytest

from sonar_component.pictures.colours import COLOUR_MAPS, NO_DATA, Tone, colour_table, fit_tone, paint


def test_a_decibel_tone_places_ten_dB_below_the_ceiling_a_quarter_below_the_top_of_forty():
    levels = Tone(ceiling=2.0, dynamic_range=40.0).levels(np.array([2.0, 0.2, 2e-4, 2e-9, 0.0, 7.0], np.float32))
    assert levels == pytest.approx([1.0, 0.75, 0.0, 0.0, 0.0, 1.0], abs=1e-6)  # float32


def test_a_linear_tone_is_proportional():
    assert Tone(2.0, 0.0).levels(np.array([0.0, 0.5, 2.0], np.float32)) == pytest.approx([0, 0.25, 1])


def test_gain_brightens():
    bins = np.linspace(0, 1, 1000, dtype=np.float32)[None]
    plain, bright = fit_tone(bins), fit_tone(bins, gain=6.0)
    assert bright.ceiling == pytest.approx(plain.ceiling * 10**-0.6)


def test_a_few_glints_do_not_darken_the_picture():
    bins = np.full((100, 1000), 0.1, np.float32)
    bins[0, :50] = 1000.0  # 0.05 % of the bins, under the 0.1 % that the tone leaves out
    assert fit_tone(bins).ceiling == pytest.approx(0.1)


@pytest.mark.parametrize("bins", [np.zeros((3, 4), np.float32), np.full((3, 4), np.nan, np.float32)])
def test_an_image_with_nothing_lit_has_a_tone_too(bins):
    assert fit_tone(bins).ceiling == 1.0


@pytest.mark.parametrize("name", COLOUR_MAPS)
def test_no_data_is_not_the_colour_of_silence_or_of_anything_heard(name):
    values = np.array([0.0, np.nan], np.float32)
    silence, nothing = paint(values, Tone(), name)
    assert tuple(nothing) == NO_DATA
    assert (silence == colour_table(name)[0]).all()
    away = np.linalg.norm(colour_table(name).astype(float) - NO_DATA, axis=1)
    assert away.min() > 40  # [of 255], a difference that an eye sees at once (about 20 is just noticeable)


@pytest.mark.parametrize("name", COLOUR_MAPS)
def test_colour_maps_rise_in_luminance(name):
    luminance = colour_table(name) @ np.array([0.2126, 0.7152, 0.0722])  # Rec. 709
    assert (np.diff(luminance) > -1.0).all()  # [of 255], rounding of the three channels
    assert luminance[-1] - luminance[0] > 150


def test_an_unknown_colour_map_is_refused_by_name():
    with pytest.raises(ValueError, match=r"one of copper, gray, viridis, got 'jet'"):
        colour_table("jet")
