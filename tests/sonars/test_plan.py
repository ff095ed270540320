"""The choice of samples, without a single picture: what is asked of the renderer and what follows from the answers."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from sonar_component.echo.beams import BeamTable, equal_angle, equal_sine, from_list
from sonar_component.render.layout import build_layout
from sonar_component.sonars.plan import LADDER, START, choose_level, highest_level, lowest_level, plan_at

DEG = np.pi / 180
MOST_TEXELS = 16384  # along each side of a texture, that every OpenGL 4.3 has
HIGHEST = len(LADDER) - 1


class Renderer:
    """Images that come closer to the truth from level to level, each with its own errors; remembers what was asked."""

    def __init__(self, *errors: float) -> None:
        self.errors, self.asked = errors, []  # type: tuple[float, ...], list[int]

    def __call__(self, level: int) -> np.ndarray:
        self.asked.append(level)
        image = np.ones((4, 25), np.float32)
        image.flat[level] += 10 * self.errors[level]  # the image has the norm 10
        return image


def falling(first: float) -> Renderer:
    """As the errors of scenes with a reference do from level to level."""
    return Renderer(*(first * 0.77**level for level in range(len(LADDER))))


@pytest.mark.parametrize("in_use", [None, 0, START, HIGHEST])
@pytest.mark.parametrize("accuracy", [0.003, 0.005, 0.02, 0.2])
def test_the_chosen_level_meets_the_target_and_a_much_coarser_one_does_not(accuracy: float, in_use: int | None) -> None:
    renderer = falling(0.1)
    level, error = choose_level(renderer, accuracy, HIGHEST, in_use)
    assert renderer.errors[level] <= accuracy
    assert error <= accuracy
    # An error is taken a quarter too large here (1.15 of a difference that holds the finer image's error too), which is
    # one level; leaving a level in use for a lower one needs a fifth of the target as room, which is another.
    spare = 2 if in_use is None or renderer.errors[in_use] > accuracy else 3
    assert level - spare < lowest_level(accuracy) or renderer.errors[level - spare] > accuracy


@pytest.mark.parametrize("in_use", [None, START])
def test_a_difficult_scene_is_approached_in_few_images(in_use: int | None) -> None:
    renderer = falling(1.0)
    choose_level(renderer, 0.02, HIGHEST, in_use)
    assert len(renderer.asked) <= 10  # of the 19 levels


def test_an_exact_scene_takes_the_coarsest_level() -> None:
    level, error = choose_level(Renderer(*np.zeros(len(LADDER))), 0.02, HIGHEST)
    assert (level, error) == (lowest_level(0.02), 0.0)


def test_an_empty_scene_takes_the_coarsest_level_and_divides_by_nothing() -> None:
    empty = choose_level(lambda level: np.zeros((4, 25), np.float32), 0.02, HIGHEST)
    assert empty == (lowest_level(0.02), 0.0)


def test_an_easy_scene_is_still_drawn_on_more_samples_the_higher_the_accuracy() -> None:
    """Something small may come into view between two looks."""
    lowest = [lowest_level(accuracy) for accuracy in (1.0, 0.1, 0.05, 0.02, 0.01, 0.003, 1e-9)]
    assert lowest == sorted(lowest)
    assert lowest[0] == 0
    assert 2 <= lowest[3] < START
    assert lowest[-1] == HIGHEST


def test_a_target_out_of_reach_ends_at_the_finest_level_and_says_what_is_left() -> None:
    renderer = Renderer(*np.linspace(0.9, 0.5, len(LADDER)))
    level, error = choose_level(renderer, 0.001, HIGHEST)
    assert level == HIGHEST
    assert error > 0.001


@pytest.mark.parametrize("highest", range(len(LADDER)))
@pytest.mark.parametrize("start", [None, 0, START, HIGHEST])
def test_no_level_beyond_the_highest_is_ever_rendered(highest: int, start: int | None) -> None:
    for renderer in (falling(0.1), Renderer(*np.linspace(0.9, 0.5, len(LADDER))), Renderer(*np.zeros(len(LADDER)))):
        level, _ = choose_level(renderer, 0.01, highest, start)
        assert 0 <= level <= highest
        assert all(0 <= asked <= highest for asked in renderer.asked)


def test_no_level_is_rendered_twice() -> None:
    for start in range(len(LADDER)):
        renderer = falling(0.1)
        choose_level(renderer, 0.003, HIGHEST, start)
        assert len(set(renderer.asked)) == len(renderer.asked)


def test_the_choice_stays_when_it_is_asked_again_from_where_it_ended() -> None:
    for first in (0.3, 0.1, 0.05, 0.013):
        level, _ = choose_level(falling(first), 0.02, HIGHEST)
        assert choose_level(falling(first), 0.02, HIGHEST, level)[0] == level


FANS = {
    "one beam": equal_angle(1, 3 * DEG, 35 * DEG),
    "one wide beam": equal_angle(1, 120 * DEG, 20 * DEG),
    "usual": equal_angle(256, 120 * DEG, 20 * DEG),
    "sine": equal_sine(512, 130 * DEG, 12 * DEG),
    "2048": equal_angle(2048, 130 * DEG, 20 * DEG),
    "4096, full turn, tall": equal_angle(4096, 360 * DEG, 150 * DEG),
    "flat": equal_angle(256, 120 * DEG, 0.1 * DEG),
    "needle": from_list(np.array([-60.0, 0.0, 1e-6, 2e-6, 60.0]) * DEG, 20 * DEG),
}


@pytest.fixture(params=FANS.values(), ids=FANS.keys())
def fan(request: pytest.FixtureRequest) -> BeamTable:
    return request.param  # type: ignore[no-any-return]


def test_every_level_fits_the_target_that_any_driver_has(fan: BeamTable) -> None:
    for level in range(highest_level(fan) + 1):
        plan = plan_at(fan, level)
        right, left = float(fan.right.min()), float(fan.left.max())
        layout = build_layout(right, left, fan.half_height, plan.column_width, plan.rows, plan.shear)
        assert layout.columns <= MOST_TEXELS
        assert layout.rows <= MOST_TEXELS
        # 4 million as planned; sheared views add a third of their rows, or half where 48 views are not narrow enough.
        assert layout.columns * layout.rows <= 1.7 * 4_000_000


def test_levels_have_more_samples_from_one_to_the_next(fan: BeamTable) -> None:
    plans = [plan_at(fan, level) for level in range(highest_level(fan) + 1)]
    for coarse, fine in pairwise(plans):
        assert fine.column_width <= coarse.column_width
        assert fine.rows > coarse.rows


def test_a_beam_has_at_least_its_columns_where_they_fit_a_texture(fan: BeamTable) -> None:
    narrowest = (fan.left - fan.right).min()
    for level in range(highest_level(fan) + 1):
        finest = fan.width / (0.9 * MOST_TEXELS)  # flat views need up to 6 % more columns, and one more each
        assert plan_at(fan, level).column_width <= max(narrowest / LADDER[level][0], finest) * (1 + 1e-12)
