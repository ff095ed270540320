"""Figures: what the PNG holds, read back as pixels."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from sonar_component.pictures.colours import NO_DATA, Tone, colour_table
from sonar_component.pictures.figure import ring_ranges, save_png, settings_line, tick_bearings, time_text
from sonar_component.samples import Sonar


def lopsided():
    """A target on the left (+30 deg), missing beams on the right."""
    bearings = np.radians(np.linspace(60, -60, 121))
    bins = np.full((121, 200), 0.001, np.float32)
    bins[26:35, 100:120] = 1.0
    bins[90:100] = np.nan
    return Sonar(
        time=1_760_000_000_123_456,
        bin_duration=0.25 / 1500,
        beam_width=np.radians(121),
        beam_height=np.radians(20),
        bearings=bearings,
        speed_of_sound=1500.0,
        bin_count=200,
        beam_count=121,
        bins=bins,
    )


def pixels_of(path, colour):
    picture = np.asarray(Image.open(path).convert("RGB")).astype(int)
    # Within 6 of 255: axes lines over the image are blended with it, and pixels under them must not decide.
    return np.argwhere(np.abs(picture - np.asarray(colour)).max(axis=2) <= 6), picture.shape


@pytest.mark.parametrize("kind", ["fan", "polar"])
def test_left_is_left_in_the_file(tmp_path, kind):
    save_png(lopsided(), tmp_path / "a.png", kind=kind, tone=Tone(1.0, 40.0))
    target, shape = pixels_of(tmp_path / "a.png", colour_table("copper")[255])
    missing, _ = pixels_of(tmp_path / "a.png", NO_DATA)
    target = target[target[:, 1] < 0.8 * shape[1]]  # the colour bar stands to the right of that
    assert len(target) > 500
    assert len(missing) > 2000
    assert target[:, 1].mean() < missing[:, 1].mean()


def test_a_file_says_what_it_shows(tmp_path):
    save_png(lopsided(), tmp_path / "a.png", name="fls.sonar_samples")
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.text["Title"] == "fls.sonar_samples"
        assert picture.text["Description"] == "121 x 200, 121 deg x 20 deg, 0 to 50 m, c 1500 m/s"


@pytest.mark.parametrize(
    ("time", "text"),
    [(0, ""), (1_500_000, "t = 1.500 s"), (1_760_000_000_123_456, "2025-10-09 08:53:20.123 UTC")],
)
def test_time_is_written_for_people(time, text):
    assert time_text(time) == text


def test_unknown_openings_are_left_out_of_the_title():
    sonar = lopsided()
    sonar.beam_height = float("nan")
    assert settings_line(sonar) == "121 x 200, 121 deg, 0 to 50 m, c 1500 m/s"


@pytest.mark.parametrize(
    ("reach", "rings"),
    [(50.0, [10, 20, 30, 40, 50]), (3.0, [0.5, 1, 1.5, 2, 2.5, 3]), (120.0, [20, 40, 60, 80, 100, 120])],
)
def test_rings_stand_at_round_metres(reach, rings):
    assert ring_ranges(reach) == pytest.approx(rings)


def test_bearing_ticks_are_round_and_a_full_turn_has_no_double():
    assert tick_bearings(-60, 60) == [-60, -45, -30, -15, 0, 15, 30, 45, 60]
    assert tick_bearings(-180, 180) == [-180, -150, -120, -90, -60, -30, 0, 30, 60, 90, 120, 150]


def test_an_unknown_kind_is_refused(tmp_path):
    with pytest.raises(ValueError, match="fan or polar, got 'cube'"):
        save_png(lopsided(), tmp_path / "a.png", kind="cube")
