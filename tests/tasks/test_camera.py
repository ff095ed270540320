"""The camera task: off unless asked for, and then at its own rate."""

from __future__ import annotations

import numpy as np
import pytest

from sonar_component.middleware import run_once
from sonar_component.middleware.clock import SteppedClock
from sonar_component.samples import RigidBodyState
from sonar_component.scene import Body, Material, Part, World, shapes
from sonar_component.tasks.camera import CameraTask

SMALL = {"width": 32, "height": 24}


def scene():
    floor = np.eye(4)
    floor[2, 3] = -8.0
    return World(
        [Body("floor", [Part(shapes.plane((40.0, 40.0)), Material("sand"), np.eye(4))], floor)]
    ).to_description()


def pose(time):
    return RigidBodyState(time=time, position=np.array([0.0, 0.0, -4.0]), orientation=np.array([1.0, 0.0, 0.0, 0.0]))


def test_it_is_off_unless_asked_for_and_opens_no_context():
    task = CameraTask("camera", SMALL)
    outputs = run_once(task, {"scene": scene(), "camera_pose_cmd": pose(1)})
    assert outputs["camera_samples"] == []
    assert task._camera is None


@pytest.mark.usefixtures("context")  # skips where there is no OpenGL
def test_it_draws_from_the_pose_and_stamps_the_picture_with_its_time():
    task = CameraTask("camera", {**SMALL, "enabled": True})
    (frame,) = run_once(task, {"scene": scene(), "camera_pose_cmd": pose(12345)})["camera_samples"]
    frame.validate()
    assert frame.time == 12345
    assert frame.image.shape == (24, 32, 3)
    assert frame.image[:10].mean() != frame.image[14:].mean()  # water above, floor below
    task.stop()
    task.cleanup()


@pytest.mark.usefixtures("context")
def test_it_keeps_its_rate_however_fast_poses_come_and_gives_the_context_back_when_switched_off():
    clock = SteppedClock(1_000_000)
    task = CameraTask("camera", {**SMALL, "enabled": True, "rate": "10 Hz"}, clock=clock)
    drawn = 0
    for step in range(50):
        inputs = {"camera_pose_cmd": pose(clock.now())} | ({"scene": scene()} if step == 0 else {})
        drawn += len(run_once(task, inputs)["camera_samples"])
        clock.time += 20_000  # 50 poses a second
    assert drawn == 10
    task.set_property("enabled", False)
    clock.time += 1_000_000
    assert run_once(task, {"camera_pose_cmd": pose(clock.now())})["camera_samples"] == []
    assert task._camera is None
    task.stop()
    task.cleanup()


def test_a_field_of_view_that_no_lens_has_is_refused():
    task = CameraTask("camera", {"field_of_view": "200 deg"})
    assert not task.configure()
    assert "field_of_view" in task.lifecycle.reason
