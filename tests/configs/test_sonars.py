"""Every device file loads, pings, begins with how to try it, and says what no source confirms."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sonar_component.samples import RigidBodyState
from sonar_component.settings import load_yaml, validate
from sonar_component.sonars.forward_looking import ForwardLookingSonar
from sonar_component.sonars.scanning import ScanningSonar
from sonar_component.sonars.scanning_settings import ScanningSettings
from sonar_component.sonars.self_test import wall_ahead
from sonar_component.sonars.settings import ForwardLookingSettings

FOLDER = Path(__file__).parents[2] / "configs" / "sonars"
FILES = sorted(FOLDER.glob("*.yaml"))
KINDS = {"forward_looking": ForwardLookingSettings, "scanning": ScanningSettings}


def settings_of(file: Path) -> Any:
    document = load_yaml(file)
    return validate(KINDS[document.data["kind"]], document)


@pytest.mark.parametrize("file", FILES, ids=lambda f: f.stem)
def test_it_pings_within_its_limits(file: Path, context: Any) -> None:
    settings = settings_of(file)
    sonar = (ScanningSonar if settings.kind == "scanning" else ForwardLookingSonar)(context, settings)
    pose = RigidBodyState(time=1, position=np.zeros(3), orientation=np.array([1.0, 0, 0, 0]))
    distance = settings.range / 2
    sample = sonar.ping(wall_ahead(distance), pose, np.random.default_rng(0))
    sonar.release()
    sample.validate()
    middle = sample.bins[sample.beam_count // 2]
    # One bin for the edge on which the wall stands, and none of it before.
    assert abs(np.flatnonzero(middle)[0] - distance / sample.bin_length) <= 1


@pytest.mark.parametrize("file", FILES, ids=lambda f: f.stem)
def test_a_range_beyond_the_device_is_refused(file: Path) -> None:
    settings = settings_of(file)
    with pytest.raises(ValueError, match="must be"):
        settings.range = settings.max_range + 1


@pytest.mark.parametrize("file", FILES, ids=lambda f: f.stem)
def test_it_says_how_to_try_it_what_is_seen_and_where_its_numbers_come_from(file: Path) -> None:
    head = re.match(r"(#.*\n)+", file.read_text())
    assert head
    text = head[0]
    assert f"configs/sonars/{file.name}" in text
    assert f"--out {file.stem}.png" in text
    assert "Expect" in text
    scene = re.search(r"--scene (\S+)", text)
    assert scene
    assert (FOLDER.parents[1] / scene[1]).is_file()
    assert ("--scan" in text) == (settings_of(file).kind == "scanning")


def test_doubts_name_what_no_source_confirms() -> None:
    [line] = settings_of(FOLDER / "ping360.yaml").doubts()
    assert line == "head_speed is our estimate: no source states the device's own"
    assert settings_of(FOLDER / "oculus_m1200d_2100khz.yaml").doubts() == []


def test_doubts_can_only_name_properties() -> None:
    with pytest.raises(ValueError, match=r"there is no 'head_sped' \(did you mean \"head_speed\"\?\)"):
        ScanningSettings(unverified=["head_sped"])


def test_the_wrong_kind_of_sonar_is_refused_in_words() -> None:
    with pytest.raises(ValueError, match=r"kind.*must be 'forward_looking', got 'scanning'"):
        validate(ForwardLookingSettings, load_yaml(FOLDER / "ping360.yaml"))


def test_the_readme_lists_every_file() -> None:
    text = (FOLDER / "README.md").read_text()
    for file in FILES:
        assert file.stem in text or f"_{file.stem.rpartition('_')[2]}`" in text, file.stem
