"""The scene's task: what it tells, what it lets be changed, and that other processes render the same world."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sonar_component.middleware import connect, connect_task, run_once
from sonar_component.middleware.operations import call, operations_of
from sonar_component.samples import RigidBodyState
from sonar_component.samples.scene_description import BodyPoses, SceneDescription
from sonar_component.scene.replica import Replica
from sonar_component.tasks.scene import SceneTask

SCENE = """version: 1
materials:
  steel: {reflectance: 1.4}
bodies:
  floor: {plane: {size: [100 m, 100 m]}, pose: {position: [0, 0, -5 m]}}
  ball: {sphere: {radius: 0.5 m}, pose: {position: [6 m, 0, 0]}, material: steel, moving: true}
"""


@pytest.fixture
def scene_file(tmp_path: Path) -> Path:
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE)
    return path


@pytest.fixture
def task(scene_file: Path) -> SceneTask:
    made = SceneTask("scene", {"world": str(scene_file)})
    assert made.configure(), made.lifecycle.reason
    return made


def pose_of(name: str, x: float, time: int = 7) -> RigidBodyState:
    return RigidBodyState(
        time=time, sourceFrame=name, targetFrame="world", position=np.array([x, 0.0, 0.0]),
        orientation=np.array([1.0, 0, 0, 0]),
    )  # fmt: skip


def told(written: dict[str, list[Any]]) -> tuple[SceneDescription, BodyPoses]:
    (description,), (poses,) = written["scene"], written["body_poses"]
    return description, poses


def test_the_world_is_told_at_the_start_and_poses_alone_after_that(task: SceneTask) -> None:
    description, poses = told(run_once(task))
    assert description.content_hash == poses.content_hash == task.world.content_hash()
    written = run_once(task, {"pose_cmd": [pose_of("ball", 7, 10), pose_of("ball", 8, 30), pose_of("ball", 9, 20)]})
    assert written["scene"] == []
    (poses,) = written["body_poses"]
    assert poses.time == 30
    assert poses.poses[1, :3, 3].tolist() == [9, 0, 0]  # the last that was sent, whatever its stamp


def test_a_pose_without_a_time_is_told_too(task: SceneTask) -> None:
    run_once(task)
    (poses,) = run_once(task, {"pose_cmd": pose_of("ball", 7, 0)})["body_poses"]
    assert poses.time > 0


def test_a_pose_for_an_unknown_body_is_refused_by_name_said_once_and_counted(
    task: SceneTask, caplog: pytest.LogCaptureFixture
) -> None:
    run_once(task)
    for _ in range(3):
        written = run_once(task, {"pose_cmd": [pose_of("bal", 7), pose_of("ball", 8)]})
        assert len(written["body_poses"]) == 1  # the others are moved all the same
    assert caplog.text.count("scene.pose_cmd: pose refused: the world has no body 'bal'; did you mean 'ball'?") == 1
    assert call(task, "refused_poses", {}) == {"bal": 3}
    assert task.lifecycle.substate == "REFUSED_POSES"
    assert "'bal'" in task.lifecycle.reason


def test_made_up_names_do_not_fill_memory(task: SceneTask) -> None:
    run_once(task)
    run_once(task, {"pose_cmd": [pose_of(f"ghost{k}", 1) for k in range(500)]})
    counts = call(task, "refused_poses", {})
    assert len(counts) <= 101
    assert sum(counts.values()) == 500


def test_a_body_is_spawned_in_the_words_of_the_scene_file_and_removed_by_name(task: SceneTask) -> None:
    before = told(run_once(task))[0].content_hash
    spawn = {"sphere": {"radius": "20 cm"}, "pose": {"position": ["3 m", 0, "1 m"]}, "material": "steel"}
    returned = call(task, "spawn", {"name": "buoy", "body": spawn})
    listed = call(task, "bodies", {})
    assert listed["buoy"] == {
        "position": [3, 0, 1], "moving": False, "parts": ["buoy"], "materials": {"steel": 1.4},
    }  # fmt: skip
    json.dumps(listed)  # it goes over the wire
    assert returned == task.world.content_hash() != before
    call(task, "remove", {"name": "buoy"})
    assert task.world.content_hash() == before
    assert list(task.world.bodies) == ["floor", "ball"]


def test_what_is_spawned_may_be_a_model_of_the_search_path(tmp_path: Path, scene_file: Path) -> None:
    home = tmp_path / "far" / "crate"
    home.mkdir(parents=True)
    (home / "model.config").write_text('<model><sdf version="1.6">model.sdf</sdf></model>')
    (home / "model.sdf").write_text(
        '<sdf version="1.6"><model name="crate"><include><uri>model://lid</uri></include></model></sdf>'
    )
    lid = tmp_path / "lids" / "lid"
    lid.mkdir(parents=True)
    (lid / "model.config").write_text('<model><sdf version="1.6">model.sdf</sdf></model>')
    box = "<visual name='v'><geometry><box><size>1 1 1</size></box></geometry></visual>"
    (lid / "model.sdf").write_text(f'<sdf version="1.6"><model name="lid"><link name="l">{box}</link></model></sdf>')
    task = SceneTask("scene", {"world": str(scene_file), "search_path": [str(tmp_path / "lids")]})
    assert task.configure(), task.lifecycle.reason
    run_once(task)
    call(task, "spawn", {"name": "crate", "body": {"sdf": str(home)}})
    assert [part.name for part in task.world.bodies["crate"].parts] == ["lid::l::v"]


def test_a_folder_that_is_not_there_is_told_by_check_and_by_configure(scene_file: Path) -> None:
    properties = SceneTask.Properties(world=str(scene_file), search_path=["/nowhere"])
    ((name, reason),) = SceneTask.check(properties, None)
    assert name == "search_path"
    assert reason.startswith("/nowhere: no such file")
    task = SceneTask("scene", {"world": str(scene_file), "search_path": ["/nowhere"]})
    assert not task.configure()
    assert "/nowhere: no such file" in task.lifecycle.reason


def test_a_material_is_set_by_settings_or_by_the_name_of_one_in_the_world(task: SceneTask) -> None:
    run_once(task)
    call(task, "set_material", {"body": "floor", "material": "steel"})
    assert task.world.bodies["floor"].parts[0].material.reflectance == 1.4
    call(task, "set_material", {"body": "ball", "material": {"reflectance": 0.35}, "part": "ball"})
    assert task.world.bodies["ball"].parts[0].material.reflectance == 0.35
    assert task.world.bodies["ball"].parts[0].material.name == "ball"  # as a body's own material in a scene file


@pytest.mark.parametrize(
    ("operation", "arguments", "reason"),
    [
        ("spawn", {"name": "ball", "body": {"box": {"size": [1, 1, 1]}}}, "already has a body 'ball'"),
        ("spawn", {"name": "b", "body": {"bx": 1}}, 'bodies.b.bx: .*did you mean "box"'),
        ("spawn", {"name": "b", "body": {"mesh": "lost.stl"}}, "bodies.b.mesh: lost.stl: no such file"),
        ("spawn", {"name": "b", "body": {"sphere": {"radius": "-1 m"}}}, "bodies.b.sphere.radius: must be greater"),
        ("spawn", {"name": "b", "body": {"sphere": {"radius": 1}, "material": "stel"}}, 'did you mean "steel"'),
        ("spawn", {"name": "b", "body": "ball.stl"}, r"scene.spawn.*body: .*dictionary"),
        ("remove", {"name": "bal"}, "no body 'bal'; did you mean 'ball'"),
        ("set_material", {"body": "ball", "material": "stel"}, 'material: no material "stel".*"steel"'),
        ("set_material", {"body": "ball", "material": {"reflectance": 0}}, "material.reflectance: must be greater"),
        ("set_material", {"body": "ball", "material": "steel", "part": "x"}, "has no part 'x'; parts: ball"),
        ("set_material", {"body": "ball", "material": {"texture_size": "1 m"}}, "texture_size belongs to the mesh"),
    ],
)
def test_a_wrong_operation_says_where_and_what_and_changes_nothing(
    task: SceneTask, operation: str, arguments: dict[str, Any], reason: str
) -> None:
    before = told(run_once(task))[0].content_hash
    with pytest.raises(ValueError, match=reason):
        call(task, operation, arguments)
    assert task.world.content_hash() == before
    assert task.scene.seq == 1


def test_operations_are_listed_with_what_they_take() -> None:
    assert set(operations_of(SceneTask)) == {"spawn", "remove", "set_material", "bodies", "refused_poses"}


def test_poses_that_come_before_their_description_wait_for_it(task: SceneTask) -> None:
    replica = Replica()
    first, poses = told(run_once(task))
    assert replica.take(None, poses) is None
    assert replica.take(first, None) is not None
    call(task, "spawn", {"name": "buoy", "body": {"sphere": {"radius": 1}}})
    (late,) = run_once(task, {"pose_cmd": pose_of("buoy", 3)})["body_poses"]
    world = replica.take(None, late)
    assert world is not None
    assert list(world.bodies) == ["floor", "ball"]  # still the old one
    world = replica.take(task.world.to_description(), None)
    assert world is not None
    assert world.bodies["buoy"].X_WB[0, 3] == 3


# ------------------------------------------------------------------ real processes

GRAPH = """
    version: 1
    tasks:
      scene: {type: SceneTask, properties: {world: SCENE}}
      pose: {type: VehiclePoseTask, activity: {periodic: 50 ms}}
      fls: {type: MultibeamSonarTask, process: sonars, properties: &small {range: 12 m, bin_count: 120, beam_count: 32}}
      other: {type: MultibeamSonarTask, process: sonars, properties: *small}
      alone: {type: MultibeamSonarTask, properties: *small}
    connections:
      - {from: pose.pose_samples, to: [fls.sonar_pose_cmd, other.sonar_pose_cmd, alone.sonar_pose_cmd], policy: data}
"""


def first_echo(sonar: Any) -> float:
    """Range of the first echo in the two beams around the middle [m]; infinite where there is none."""
    lit = np.flatnonzero(np.asarray(sonar.bins)[15:17].max(axis=0) > 0.05)
    return float(lit[0] * 12 / 120) if len(lit) else np.inf


def test_sonars_in_other_processes_see_what_moves_comes_goes_and_changes(graph: Any, scene_file: Path) -> None:
    graph.start(GRAPH.replace("SCENE", str(scene_file)))
    names = ("fls", "other", "alone")
    ports = [connect(f"{name}.sonar_samples", policy="data", timeout=30.0) for name in names]
    try:
        with connect_task("scene", timeout=20.0) as scene:

            def all_see(what: Any, why: str) -> None:
                for name, port in zip(names, ports, strict=True):
                    graph.wait_for(lambda port=port: what(port.read()), f"{name}: {why}")

            all_see(lambda s: abs(first_echo(s) - 5.5) < 0.11, "a ball of 0.5 m at 6 m")
            loud = np.asarray(ports[2].read().bins)[16].max()
            scene.call("set_material", body="ball", material={"reflectance": 0.35})
            all_see(lambda s: np.asarray(s.bins)[16].max() < 0.5 * loud, "a fainter ball")
            scene.call("set_material", body="ball", material="default")  # that of the floor
            scene.call("spawn", name="wall", body={"box": {"size": [0.2, 4, 4]}, "pose": {"position": [4, 0, 0]}})
            all_see(lambda s: abs(first_echo(s) - 3.9) < 0.11, "a wall before it")
            scene.call("remove", name="wall")
            all_see(lambda s: abs(first_echo(s) - 5.5) < 0.11, "the ball again")
            # Both tasks of one process draw the same bytes as the one that is alone.
            images = {np.asarray(port.read().bins).tobytes() for port in ports}
            assert len(images) == 1
    finally:
        for port in ports:
            port.close()


def test_a_moving_body_is_seen_where_its_pose_says_by_a_sonar_in_another_process(graph: Any, scene_file: Path) -> None:
    graph.start(
        """
        version: 1
        tasks:
          scene: {type: SceneTask, properties: {world: SCENE}}
          ball:
            type: VehiclePoseTask
            activity: {periodic: 50 ms}
            properties: {frame: ball, position: [9 m, 0 m, 0 m]}
          pose: {type: VehiclePoseTask, activity: {periodic: 50 ms}}
          fls: {type: MultibeamSonarTask, properties: {range: 12 m, bin_count: 120, beam_count: 32}}
        connections:
          - {from: ball.pose_samples, to: [scene.pose_cmd]}
          - {from: pose.pose_samples, to: [fls.sonar_pose_cmd], policy: data}
        """.replace("SCENE", str(scene_file))
    )
    with connect("fls.sonar_samples", policy="data", timeout=30.0) as port:
        graph.wait_for(lambda: abs(first_echo(port.read()) - 8.5) < 0.11, "the ball at 9 m")
