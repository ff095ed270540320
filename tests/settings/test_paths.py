"""Where a named file is looked for."""

from __future__ import annotations

from pathlib import Path

import pytest

from sonar_component.settings import SettingsError, find_file
from sonar_component.settings.paths import data_root


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working directory with a file two folders down."""
    (tmp_path / "a" / "b").mkdir(parents=True)
    (tmp_path / "a" / "b" / "deployment.yaml").write_text("")
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    return tmp_path


def test_a_file_beside_the_one_that_names_it_comes_first(here: Path) -> None:
    for folder in ("work", "a", "a/b"):
        (here / folder / "scene.obj").write_text("")
    beside = here / "a" / "b" / "deployment.yaml"
    assert find_file("scene.obj", beside) == here / "a" / "b" / "scene.obj"
    (here / "a" / "b" / "scene.obj").unlink()
    assert find_file("scene.obj", beside) == here / "a" / "scene.obj"
    (here / "a" / "scene.obj").unlink()
    assert find_file("scene.obj", beside) == here / "work" / "scene.obj"


def test_what_comes_with_the_package_is_found_from_any_folder(here: Path) -> None:
    assert find_file("configs/sonars/gemini_720i.yaml") == data_root() / "configs/sonars/gemini_720i.yaml"
    assert find_file("deploy/demo.yaml").is_file()


def test_a_file_of_the_user_s_own_wins_over_the_package_s(here: Path) -> None:
    mine = here / "work" / "deploy" / "demo.yaml"
    mine.parent.mkdir()
    mine.write_text("")
    assert find_file("deploy/demo.yaml") == mine


def test_an_absolute_name_is_taken_as_it_is(here: Path) -> None:
    (here / "work" / "x.obj").write_text("")
    with pytest.raises(SettingsError, match="no such file"):
        find_file(here / "x.obj")


def test_a_file_that_is_nowhere_is_told_with_the_nearest_name_and_the_places(here: Path) -> None:
    (here / "work" / "wreck.obj").write_text("")
    with pytest.raises(SettingsError) as caught:
        find_file("wrekc.obj")
    assert str(caught.value).startswith('wrekc.obj: no such file (did you mean "wreck.obj"?); looked in ')
    assert str(here / "work") in str(caught.value)


@pytest.mark.parametrize("name", ["n" * 300, "a\0b", "~nobody_of_that_name/x", "x/" * 3000])
def test_a_name_that_no_file_can_have_is_only_not_found(here: Path, name: str) -> None:
    with pytest.raises(SettingsError, match="no such file"):
        find_file(name)
