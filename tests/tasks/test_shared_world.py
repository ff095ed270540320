"""Two sonars of one process: one world in GPU memory, drawn in turns from two threads."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np

from sonar_component.gl import share_context
from sonar_component.middleware import run_once
from sonar_component.samples import RigidBodyState
from sonar_component.scene import Body, Material, Part, World
from sonar_component.scene.shapes import plane, sphere
from sonar_component.tasks.multibeam_sonar import MultibeamSonarTask
from sonar_component.tasks.scanning_sonar import ScanningSonarTask

RANGE = {"range": 10.0, "bin_count": 100}


def world() -> World:
    X, ball = np.eye(4), np.eye(4)
    X[2, 3], ball[:3, 3] = -2.0, (5.0, 0.0, 0.0)
    floor = Part(plane((60.0, 60.0)), Material("sand"), np.eye(4))
    return World([
        Body("floor", [floor], X), Body("ball", [Part(sphere(0.5), Material("m"), np.eye(4))], ball, moving=True),
    ])  # fmt: skip


def pose_at(time: int, yaw: float) -> RigidBodyState:
    orientation = np.array([np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)])
    return RigidBodyState(time=time, position=np.zeros(3), orientation=orientation)


def images(task: Any, count: int) -> list[bytes]:
    made = []
    for k in range(count):
        written = run_once(task, {"sonar_pose_cmd": pose_at(1_000_000 + 20_000 * k, 0.02 * k)})
        made += [np.asarray(sample.bins).tobytes() for sample in written["sonar_samples"]]
    return made


def start(task: Any, description: Any) -> Any:
    assert task.configure(), task.lifecycle.reason
    run_once(task, {"scene": description})
    return task


def tasks(description: Any) -> list[Any]:
    fan = {**RANGE, "beam_count": 32, "beam_width": 1.5}
    return [
        start(MultibeamSonarTask("fls", fan), description),
        start(MultibeamSonarTask("other", fan | {"beam_width": 0.7}), description),
    ]


def test_two_threads_draw_the_same_images_as_one_after_the_other() -> None:
    description = world().to_description(1)
    alone = []
    for task in tasks(description):
        alone.append(images(task, 25))
        task.stop()
        task.cleanup()
    together: dict[str, list[bytes]] = {}
    pair = tasks(description)
    threads = [threading.Thread(target=lambda t=t: together.update({t.name: images(t, 25)})) for t in pair]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [together["fls"], together["other"]] == alone
    assert all(len(set(made)) > 10 for made in alone)  # they do look elsewhere each time
    for task in pair:
        task.stop()
        task.cleanup()


def test_sonars_of_all_kinds_share_one_world_until_the_last_is_cleaned_up() -> None:
    description = world().to_description(1)
    fan = start(MultibeamSonarTask("fls", {**RANGE, "beam_count": 8}), description)
    head = start(ScanningSonarTask("msis", RANGE), description)
    assert images(fan, 1)
    shared = share_context()
    with shared as context:
        (loaded,) = context.extra["loaded_worlds"].values()
        assert loaded.users == 1  # the scanning head has not pinged yet
    now = head.now()
    assert run_once(head, {"sonar_pose_cmd": [pose_at(now - 100_000, 0.0), pose_at(now, 0.1)]})["sonar_samples"]
    assert loaded.users == 2
    for task in (fan, head):
        task.stop()
        task.cleanup()
    with shared as context:
        assert loaded.users == 0
        assert not context.extra["loaded_worlds"]
    shared.release()


def test_a_property_out_of_the_blue_changes_one_sonar_only() -> None:
    description = world().to_description(1)
    pair = tasks(description)
    before = images(pair[1], 1)
    pair[0].set_property("range", 20.0)
    pair[0].set_property("beam_count", 5)
    assert len(images(pair[0], 1)[0]) == 5 * 100 * 4
    assert images(pair[1], 1) == before
    for task in pair:
        task.stop()
        task.cleanup()
