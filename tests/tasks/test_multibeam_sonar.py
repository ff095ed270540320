"""MultibeamSonarTask, driven without sockets, threads or sleep."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sonar_component.middleware.clock import SteppedClock
from sonar_component.middleware.once import run_once
from sonar_component.samples import RigidBodyState
from sonar_component.sonars.self_test import wall_ahead
from sonar_component.tasks.multibeam_sonar import MultibeamSonarTask
from sonar_component.tasks.scanning_sonar import ScanningSonarTask

START = 1_000_000_000  # [us]
SETTINGS: dict[str, Any] = {"range": 10.0, "bin_count": 100, "enable_speckle_noise": True, "seed": 7}


@pytest.fixture
def images() -> Any:
    """The bins that a task writes for poses at these times [us after START], with noise."""
    tasks: list[Any] = []

    def run(times: list[int], name: str = "fls", kind: type[Any] = MultibeamSonarTask, **changed: Any) -> list[Any]:
        clock = SteppedClock(START)
        task = kind(name, {**SETTINGS, **changed}, clock=clock)
        tasks.append(task)
        scene, found = [wall_ahead(6.0).to_description(START)], []
        for time in times:
            clock.time = START + time
            pose = RigidBodyState.at((0.0, 0.0, 0.0), time=START + time)
            found += [s.bins for s in run_once(task, {"scene": scene, "sonar_pose_cmd": [pose]})["sonar_samples"]]
            scene = []
        return found

    yield run
    for task in tasks:
        task.stop()
        task.cleanup()


def test_the_noise_of_a_ping_does_not_depend_on_the_pings_before_it(images: Any) -> None:
    one, two, three = images([100_000, 200_000, 300_000], beam_count=16)
    (alone,) = images([300_000], beam_count=16)
    np.testing.assert_array_equal(alone, three)
    assert not np.array_equal(one, two)


def test_another_seed_or_another_sonar_has_noise_of_its_own(images: Any) -> None:
    (first,), (seeded,), (named,) = (
        images([100_000], beam_count=16, **changed) for changed in ({}, {"seed": 8}, {"name": "other"})
    )
    assert not np.array_equal(first, seeded)
    assert not np.array_equal(first, named)


def test_the_noise_of_a_beam_does_not_depend_on_the_beams_before_it(images: Any) -> None:
    # Four steps of 90 degrees and the head looks where it began.
    settings: dict[str, Any] = {
        "name": "msis", "kind": ScanningSonarTask, "min_ping_period": 0.1, "head_speed": 900.0, "motor_step": "90 deg",
    }  # fmt: skip
    turn = images([100_000, 200_000, 300_000, 400_000, 500_000], **settings)
    alone = images([500_000], **settings)
    assert (len(turn), len(alone)) == (5, 1)
    np.testing.assert_array_equal(alone[0], turn[4])
    assert not np.array_equal(turn[0], turn[4])
