"""A fan in characters: shape, sides, and what is not there."""

from __future__ import annotations

import re

import numpy as np

from sonar_component.pictures.colours import Tone
from sonar_component.pictures.text import text_picture
from sonar_component.samples import Sonar

TONE = Tone(1.0, 40.0)


def fan(bins):
    beams, count = bins.shape
    return Sonar(
        time=1,
        bin_duration=0.1 / 1500,
        beam_width=np.radians(120),
        bearings=np.radians(np.linspace(60, -60, beams)),
        speed_of_sound=1500.0,
        bin_count=count,
        beam_count=beams,
        bins=bins.astype(np.float32),
    )


def test_a_target_on_the_left_is_drawn_on_the_left():
    bins = np.zeros((121, 300))
    bins[25:36, 200:210] = 1.0  # +30 deg, two thirds out
    lines = text_picture(fan(bins), 80, tone=TONE).splitlines()
    places = [(row, column) for row, line in enumerate(lines) for column, letter in enumerate(line) if letter == "@"]
    rows, columns = zip(*places, strict=True)
    assert max(columns) < 40
    assert min(rows) > 0
    assert all(len(line) <= 80 for line in lines)


def test_no_data_has_a_letter_of_its_own():
    bins = np.zeros((121, 300))
    bins[:60] = np.nan
    text = text_picture(fan(bins), 60, tone=TONE)
    assert "?" in text
    assert all("?" not in line[32:] for line in text.splitlines())


def test_one_strong_bin_among_many_is_not_lost():
    bins = np.zeros((512, 2000))
    bins[300, 1500] = 1.0
    assert text_picture(fan(bins), 40, tone=TONE).count("@") == 1


def test_in_colour_the_letters_are_half_blocks_and_each_line_ends_plain():
    bins = np.random.default_rng(1).random((64, 100))
    lines = text_picture(fan(bins), 50, colour=True, tone=TONE).splitlines()
    bare = [re.sub(r"\x1b\[[0-9;]*m", "", line) for line in lines]
    assert set("".join(bare)) <= set(" ▀▄")
    assert all(line.endswith("\x1b[0m") for line in lines)
    assert all(len(line) <= 50 for line in bare)
