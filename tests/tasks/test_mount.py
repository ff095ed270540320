"""Where sensors sit on a vehicle, by name and in place."""

from __future__ import annotations

from pathlib import Path

import pytest

from sonar_component.settings import SettingsError
from sonar_component.tasks.mount import find_mount
from sonar_component.tasks.multibeam_sonar import MultibeamSonarTask
from sonar_component.tasks.scanning_sonar import ScanningSonarTask

VEHICLE = "configs/vehicles/auv.yaml"


def test_one_vehicle_carries_two_scanning_sonars_and_a_forward_looking_one() -> None:
    places = {name: find_mount(VEHICLE, name, None).position for name in ("fls", "msis_top", "msis_back")}
    assert len(set(places.values())) == 3


def test_an_unknown_mount_is_refused_with_the_nearest_name_before_anything_starts() -> None:
    with pytest.raises(SettingsError, match=r"has no mount 'msis_topp' \(did you mean \"msis_top\"\?\); it has: fls, "):
        find_mount(VEHICLE, "msis_topp", None)
    for task in (MultibeamSonarTask, ScanningSonarTask):
        properties = task.Properties.model_validate({"vehicle": VEHICLE, "mount": "msis_topp"})
        [(key, message)] = task.check(properties, None)
        assert key == "mount"
        assert "did you mean" in message


def test_a_name_without_a_vehicle_s_file_is_refused() -> None:
    with pytest.raises(ValueError, match="mount 'fls' is a name: give the vehicle's file as vehicle"):
        MultibeamSonarTask.Properties.model_validate({"mount": "fls"})


def test_a_mount_in_a_file_is_checked_with_its_line(tmp_path: Path) -> None:
    (tmp_path / "v.yaml").write_text("version: 1\nmounts:\n  fls: {position: [1 m, 2 deg, 0]}\n")
    with pytest.raises(SettingsError, match=r"v.yaml:3:.*mounts.fls.position"):
        find_mount("v.yaml", "fls", tmp_path / "d.yaml")
