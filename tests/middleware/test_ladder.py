"""When a process that was ordered to stop is stopped by force: a clock and a processor of our own."""

from __future__ import annotations

import signal
import time

from sonar_component.middleware.ladder import GRACE, MOST_GRACE, TERM_GRACE, Ladder

STEP = 0.05  # [s], between two looks


def climb(share: float, until: float = 30.0, stops_working: float = float("inf")) -> dict[str, float]:
    """Signal -> seconds after the order, of a process that uses a share of one processor."""
    now = begin = time.monotonic()
    ladder = Ladder(lambda: share * (min(now, begin + stops_working) - begin))
    sent: dict[str, float] = {}
    while now < begin + until:
        number = ladder.due(now)
        if number is not None:
            sent[signal.Signals(number).name] = now - begin
        now += STEP
    return sent


def near(sent: dict[str, float], **expected: float) -> bool:
    """Within a window of 0.25 s and a step on either side."""
    return sent.keys() == expected.keys() and all(abs(sent[name] - expected[name]) < 0.4 for name in expected)


def test_one_that_waits_for_something_is_climbed_after_as_before() -> None:
    assert near(climb(0.0), SIGTERM=GRACE, SIGKILL=GRACE + TERM_GRACE)


def test_what_threads_of_the_middleware_use_is_no_work() -> None:
    assert near(climb(0.02), SIGTERM=GRACE, SIGKILL=GRACE + TERM_GRACE)  # 30 frames of a megabyte a second


def test_one_that_works_is_given_time_also_where_it_has_a_tenth_of_a_processor() -> None:
    assert climb(0.1, until=10.0) == {}


def test_one_that_works_for_ever_is_stopped_all_the_same() -> None:
    assert near(climb(1.0), SIGTERM=MOST_GRACE, SIGKILL=MOST_GRACE + TERM_GRACE)


def test_one_that_hangs_after_it_has_worked_is_given_the_usual_grace_from_then_on() -> None:
    assert near(climb(1.0, stops_working=5.0), SIGTERM=5.0 + GRACE, SIGKILL=5.0 + GRACE + TERM_GRACE)
