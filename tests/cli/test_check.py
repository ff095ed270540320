"""`sonar check` of what a deployment names: sonars and scenes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sonar_component.cli.check import check_files

ROOT = Path(__file__).parents[2]
SCENE = "version: 1\nbodies:\n  ball: {sphere: {radius: 1 m}}\n"


@pytest.mark.parametrize("file", sorted((ROOT / "configs/sonars").glob("*.yaml")), ids=lambda file: file.stem)
def test_every_sonar_is_good_and_its_estimates_are_said(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert check_files([file]) == 0
    out, err = capsys.readouterr()
    assert out.startswith(f"{file}: good: a ")
    assert ("our estimate" in err) == ("unverified: []" not in file.read_text())


def test_a_scene_is_good_with_its_bodies_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "scene.yaml").write_text(SCENE)
    assert check_files([tmp_path / "scene.yaml"]) == 0
    assert "good: a scene of 1 body, " in capsys.readouterr().out
    assert check_files([tmp_path / "scene.yaml"], as_json=True) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["bodies"], told["warnings"]) == (["ball"], [])


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("sonar.yaml", "range: 30 m\ngian: 0.5\n", ':2:1: gian: is not a known key (did you mean "gain"?)'),
        ("sonar.yaml", "kind: scaning\nrange: 30 m\n", ":1:1: kind: must be forward_looking or scanning"),
        ("sonar.yaml", "range: 30 deg\n", ":1:1: range: must be of length"),
        ("scene.yaml", "version: 1\nbodies:\n  ball: {spher: {radius: 1 m}}\n", ':3:10: bodies.ball.spher: '),
        ("scene.yaml", "version: 1\nbodies:\n  wreck: {mesh: gone.glb}\n", ":3:11: bodies.wreck.mesh: gone.glb"),
        ("broken.obj", "this is no mesh", "broken.obj"),
        ("notes.txt", "a", "is not a scene known here"),
        ("deployment.yaml", "version: 1\ntaks: {}\n", ':2:1: taks: is not a known key (did you mean "tasks"?)'),
    ],
)  # fmt: skip
def test_a_mistake_is_told_as_that_of_a_deployment_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, text: str, said: str
) -> None:
    (tmp_path / name).write_text(text)
    assert check_files([tmp_path / name]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert said in err
    assert str(tmp_path / name) in err
