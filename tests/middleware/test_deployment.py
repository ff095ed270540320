from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from sonar_component.middleware.deployment import Plan, check_deployment
from sonar_component.settings import SettingsError
from sonar_component.settings.errors import SettingsErrors

GOOD = """\
version: 1
tasks:
  pose: {type: VehiclePoseTask, activity: {periodic: 20 ms}}
  scene: {type: SceneTask, properties: {world: configs/scenes/wreck_site/scene.yaml}}
  fls:
    type: MultibeamSonarTask
    process: gpu
    config: [configs/sonars/gemini_720i.yaml]
    properties: {range: 30 m}
connections:
  - {from: pose.pose_samples, to: [fls.sonar_pose_cmd], policy: data, max_age: 500 ms}
"""


def check(tmp_path: Path, text: str, **more: Any) -> Plan:
    file = tmp_path / "deployment.yaml"
    file.write_text(text)
    return check_deployment(file, **more)


def test_a_good_deployment_becomes_a_plan(tmp_path: Path) -> None:
    plan = check(tmp_path, GOOD)
    assert plan.name == "deployment"
    assert plan.task("fls").process == "gpu"
    assert plan.task("fls").properties["range"] == "30 m"
    assert plan.task("fls").properties["beam_count"] == 256  # from the config file
    assert plan.task("pose").activity == {"periodic": 0.02}
    connection = plan.connections[0]
    assert (connection.source, connection.target) == ("pose.pose_samples", "fls.sonar_pose_cmd")
    assert (connection.policy, connection.init, connection.max_age) == ("data", True, 0.5)


def test_what_there_is_one_of_connects_itself(tmp_path: Path) -> None:
    lines = {(c.source, c.target) for c in check(tmp_path, GOOD).connections}
    assert ("scene.scene", "fls.scene") in lines


def test_a_plan_survives_being_written_down(tmp_path: Path) -> None:
    plan = check(tmp_path, GOOD)
    assert Plan.from_json(plan.to_json()) == plan


def test_values_from_the_command_line_count_last(tmp_path: Path) -> None:
    assert check(tmp_path, GOOD, overrides={"fls": {"range": 9}}).task("fls").properties["range"] == 9


MISTAKES = [
    ("version: 1", "version: 2", 1, "version: must be 1"),
    ("tasks:", "taks:", 2, 'is not a known key (did you mean "tasks"?)'),
    ("type: SceneTask", "type: SeneTask", 4, '(did you mean "SceneTask"?)'),
    ("type: SceneTask", "type: os.system", 4, "is not a known task type"),
    ("activity: {periodic: 20 ms}", "activity: {periodic: 20 m}", 3, "'m' is of length, got '20 m'"),
    ("activity: {periodic: 20 ms}", "activity: {periodic: 0 ms}", 3, "must be above 0"),
    ("activity: {periodic: 20 ms}", "activity: {periodc: 20 ms}", 3, '(did you mean "periodic"?)'),
    ("activity: {periodic: 20 ms}", "activity: {slave: pos}", 3, 'no task \'pos\' (did you mean "pose"?)'),
    ("activity: {periodic: 20 ms}", "activity: {slave: scene}", 3, "must be in the same process: write process: scene"),
    ("activity: {periodic: 20 ms}", "activity: {slave: pose}", 3, "is a circle"),
    ("scene.yaml}", "scen.yaml}", 4, 'no such file (did you mean "scene.yaml"?)'),
    ("world: configs", "wold: configs", 4, '(did you mean "world"?)'),
    ("gemini_720i.yaml", "gemini_720.yaml", 8, 'no such file (did you mean "gemini_720i.yaml"?)'),
    ("range: 30 m", "range: 0", 9, "must be 0.1 m to 1000 m, got 0 m"),
    ("range: 30 m", "range: 500000 m", 9, "must be 0.1 m to 1000 m"),
    ("range: 30 m", "range: 30 deg", 9, "'deg' is of angle"),
    ("range: 30 m", "rnage: 30 m", 9, '(did you mean "range"?)'),
    ("range: 30 m", "range: 30 m, range: 20 m", 9, "stands twice"),
    ("range: 30 m", "bin_count: 010x", 9, "bin_count"),
    ("pose.pose_samples", "pose.pose_sample", 11, '(did you mean "pose_samples"?)'),
    ("pose.pose_samples", "poes.pose_samples", 11, 'no task \'poes\' (did you mean "pose"?)'),
    ("pose.pose_samples", "scene.scene", 11, "takes RigidBodyState, but scene.scene gives SceneDescription"),
    ("from: pose.pose_samples", "from: fls.sonar_pose_cmd", 11, "sonar_pose_cmd is an input"),
    ("to: [fls.", "to: [fls.sonar_pose_cmd, fls.", 11, "is connected to fls.sonar_pose_cmd already"),
    ("policy: data", "policy: latest", 11, "must be data, or a kind with its size"),
    ("policy: data", "policy: buffer", 11, "write {buffer: 4}"),
    ("policy: data", "policy: {buffer: 0}", 11, "must be at least 1, got 0"),
    ("max_age: 500 ms", "max_age: 500 m", 11, "'m' is of length"),
    ("max_age: 500 ms", "max_age: 500", 11, 'must be at most 300, got 500 (did you mean "500 ms"?)'),
    ("activity: {periodic: 20 ms}", "activity: {periodic: 200}", 3, '(did you mean "200 ms"?)'),
    ("activity: {periodic: 20 ms}", "activity: periodic", 3, "must be a mapping of keys to values, got 'periodic'"),
    ("activity: {periodic: 20 ms}", "restart: allways", 3, '(did you mean "always"?)'),
    ("policy: data", "policy: circular_bufer", 11, '(did you mean "circular_buffer"?)'),
    ("process: gpu", "process: ../gpu", 7, "must be letters, digits"),
]  # fmt: skip


@pytest.mark.parametrize(("good", "bad", "line", "message"), MISTAKES, ids=lambda value: str(value)[:40])
def test_every_mistake_is_named_with_its_line(tmp_path: Path, good: str, bad: str, line: int, message: str) -> None:
    assert good in GOOD
    with pytest.raises(SettingsError) as caught:
        check(tmp_path, GOOD.replace(good, bad, 1))
    (text,) = str(caught.value).splitlines()  # and nothing that only follows from it
    assert message in text
    assert f"deployment.yaml:{line}:" in text


def test_an_input_that_nothing_or_more_than_one_could_feed_must_be_connected(tmp_path: Path) -> None:
    alone = GOOD.split("connections:")[0]
    assert ("pose.pose_samples", "fls.sonar_pose_cmd") in {
        (c.source, c.target) for c in check(tmp_path, alone).connections
    }
    message = r"deployment\.yaml:6:3: tasks\.fls: input port sonar_pose_cmd \(RigidBodyState\) must be connected"
    with pytest.raises(SettingsError, match=message):
        check(tmp_path, alone.replace("tasks:\n", "tasks:\n  other: {type: VehiclePoseTask}\n"))


def test_all_mistakes_are_told_at_once_and_in_order(tmp_path: Path) -> None:
    wrong = (
        GOOD.replace("SceneTask", "SeneTask")
        .replace("range: 30 m", "range: 0, gain: 7")
        .replace("pose.pose", "poes.pose")
    )
    with pytest.raises(SettingsError) as caught:
        check(tmp_path, wrong)
    lines = [line.split(":")[1] for line in str(caught.value).splitlines()]
    assert lines == ["4", "9", "9", "11"]


EVERY_MISTAKE = """\
version: 2
nmae: everything
clock: {mode: sim, rate: fast}
defaults: {restart: allways, hang_timeout: 10 m}
hosts:
  vehicle: {address: 10.0.0.4}
  topside: {address: "not an address!"}
insecure: perhaps
tasks:
  pose: {type: VehiclePoseTask, activity: {periodic: 20 m}}
  scene: {type: SeneTask, properties: {world: nowhere.yaml}, process: [a]}
  other: {typ: SceneTask, properties: {world: nowhere.yaml}, host: vehicel}
  third: {properties: {}}
  fourth: 5
  9th: {type: ViewerTask}
  slave: {type: VehiclePoseTask, activity: {slave: pos}}
  bogus: {type: VehiclePoseTask, activity: {bogus: 3}, max_restarts: -1}
  fls:
    type: MultibeamSonarTask
    process: ../gpu
    config: [configs/sonars/gemini_720.yaml]
    properties: {range: 30 deg, gain: 7, rnage: 4}
    activity: {port_driven: [sonar_pose_cdm]}
  fls:
    type: MultibeamSonarTask
  msis: {type: ScanningSonarTask, properties: 5}
connections:
  - {from: pose.pose_samples, to: [fls.sonar_pose_cdm], policy: latest, max_age: 500 m}
  - {from: pose.pose_sample, to: fls.sonar_pose_cmd, policy: {buffer: 0}}
  - {from: fls.sonar_samples, to: [fls.sonar_pose_cmd], policyy: data}
  - {to: [nobody.there]}
  - {from: pose.pose_samples, to: 7}
  - hello
"""
ALL_OF_THEM = [  # line, column, key
    (1, 1, "version"), (2, 1, "nmae"), (3, 20, "clock.rate"), (4, 12, "defaults.restart"),
    (4, 30, "defaults.hang_timeout"), (7, 13, "hosts.topside.address"), (8, 1, "insecure"),
    (10, 44, "tasks.pose.activity.periodic"), (11, 11, "tasks.scene.type"), (11, 62, "tasks.scene.process"),
    (12, 11, "tasks.other.typ"), (12, 40, "tasks.other.properties.world"), (12, 62, "tasks.other.host"),
    (13, 3, "tasks.third.type"), (14, 3, "tasks.fourth"), (15, 3, "tasks.9th"), (16, 45, "tasks.slave.activity.slave"),
    (17, 45, "tasks.bogus.activity.bogus"), (17, 56, "tasks.bogus.max_restarts"), (20, 5, "tasks.fls.process"),
    (21, 14, "tasks.fls.config.0"), (22, 18, "tasks.fls.properties.range"), (22, 33, "tasks.fls.properties.gain"),
    (22, 42, "tasks.fls.properties.rnage"), (23, 30, "tasks.fls.activity.port_driven.0"), (24, 3, "tasks.fls"),
    (26, 35, "tasks.msis.properties"), (28, 36, "connections.0.to.0"), (28, 57, "connections.0.policy"),
    (28, 73, "connections.0.max_age"), (29, 6, "connections.1.from"), (29, 63, "connections.1.policy.buffer"),
    (30, 36, "connections.2.to.0"), (30, 57, "connections.2.policyy"), (31, 5, "connections.3.from"),
    (31, 11, "connections.3.to.0"), (32, 31, "connections.4.to"), (33, 5, "connections.5"),
]  # fmt: skip


def test_one_mistake_of_each_kind_is_told_once_in_one_go_and_in_order(tmp_path: Path) -> None:
    with pytest.raises(SettingsErrors) as caught:
        check(tmp_path, EVERY_MISTAKE)
    assert [(error.line, error.column, error.key) for error in caught.value.errors] == ALL_OF_THEM


ACROSS_HOSTS = """\
version: 1
hosts:
  vehicle: {address: 10.0.0.4}
  topside: {address: 127.0.0.1}
clock: {mode: sim}
tasks:
  pose: {type: VehiclePoseTask, host: vehicle}
  fls: {type: MultibeamSonarTsk, host: topside}
connections:
  - {from: pose.pose_samples, to: [fls.sonar_pose_cmd], policy: {reliable: 2}}
"""


def test_mistakes_across_hosts_are_told_beside_a_wrong_type(tmp_path: Path) -> None:
    with pytest.raises(SettingsErrors) as caught:
        check(tmp_path, ACROSS_HOSTS)
    assert [error.key for error in caught.value.errors] == [
        "hosts.vehicle", "clock.mode", "tasks.fls.type", "connections.0",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("sections", "message"),
    [
        ("sections: 5", r"fls\.yaml:1:1: sections: must be a mapping of keys to values, got 5"),
        ("sections: {default: 5}", r"fls\.yaml:1:12: sections\.default: must be a mapping of keys to values, got 5"),
        ("range: 3\nrange: 4\ngain: 1\ngain: 1", r"fls\.yaml:2:1: range: stands twice.*\n.*yaml:4:1: gain: stands"),
    ],
)
def test_a_config_file_of_another_form_is_told_of(tmp_path: Path, sections: str, message: str) -> None:
    (tmp_path / "fls.yaml").write_text(sections)
    with pytest.raises(SettingsErrors, match=message):
        check(tmp_path, GOOD.replace("configs/sonars/gemini_720i.yaml", "fls.yaml"))


@pytest.mark.parametrize("tasks", ["5", "[a]", "{fls: 5}", "{fls: {type: ViewerTask, properties: 5}}", "{5: {}}", ""])
def test_values_from_the_command_line_are_laid_over_tasks_alone(tmp_path: Path, tasks: str) -> None:
    with pytest.raises(SettingsError):
        check(tmp_path, f"version: 1\ntasks: {tasks}\n", overrides={"fls": {"range": 9}})


def test_sections_of_config_files_are_laid_over_each_other_from_left_to_right(tmp_path: Path) -> None:
    (tmp_path / "fls.yaml").write_text("sections:\n  default: {range: 10 m, gain: 0.1}\n  far: {range: 80 m}\n")
    chosen = GOOD.replace("[configs/sonars/gemini_720i.yaml]", "[fls.yaml, default, far]").replace(
        "{range: 30 m}", "{}"
    )
    assert check(tmp_path, chosen).task("fls").properties == {"range": "80 m", "gain": 0.1}
    alone = chosen.replace("[fls.yaml, default, far]", "[fls.yaml]")
    assert check(tmp_path, alone).task("fls").properties == {"range": "10 m", "gain": 0.1}
    with pytest.raises(SettingsError, match=r'no section .fra. \(did you mean "far"\?\); it has: default, far'):
        check(tmp_path, chosen.replace("far]", "fra]"))


def test_a_mistake_in_a_config_file_is_named_there(tmp_path: Path) -> None:
    (tmp_path / "fls.yaml").write_text("range: 10 m\nbin_count: 0\n")
    with pytest.raises(SettingsError, match=r"fls\.yaml:2:1: bin_count: must be at least 1, got 0"):
        check(tmp_path, GOOD.replace("configs/sonars/gemini_720i.yaml", "fls.yaml"))
