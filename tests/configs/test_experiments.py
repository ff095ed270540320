"""The paper's six experiments: every deployment is good, says what is to be seen, and has its picture."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from sonar_component.middleware.deployment import check_deployment
from sonar_component.tasks.scanning_sonar import ScanningSonarProperties
from sonar_component.tasks.waypoint_file import read_waypoints

TOP = Path(__file__).parents[2]
EXPERIMENTS = ("fls_target", "fls_isolation_valve", "fls_docking", "msis_tank", "msis_grid_turning", "msis_slope")


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_an_experiment_is_good_and_says_what_is_to_be_seen(name: str) -> None:
    file = TOP / "deploy" / f"{name}.yaml"
    plan = check_deployment(file)
    sonars = [task for task in plan.tasks if task.type.endswith("SonarTask")]
    assert [task.type for task in sonars] == ["MultibeamSonarTask" if name.startswith("fls") else "ScanningSonarTask"]
    assert sonars[0].properties["vehicle"] == "configs/vehicles/auv.yaml"
    head = file.read_text()
    assert f"sonar run deploy/{name}.yaml" in head
    assert f"sonar snapshot {sonars[0].name}.sonar_samples" in head
    assert "To be seen" in head
    picture = TOP / "deploy" / f"{name}.png"
    assert 10_000 < picture.stat().st_size < 150_000
    assert f"({name}.png)" in (TOP / "deploy" / "README.md").read_text()


def test_the_vehicle_of_the_fifth_turns_20_degrees_in_exactly_one_scan() -> None:
    plan = check_deployment(TOP / "deploy" / "msis_grid_turning.yaml")
    sonar = ScanningSonarProperties.model_validate(plan.task("msis_top").properties)
    pings = 2 * math.pi / sonar.motor_step
    times, _, orientations = read_waypoints(
        TOP / "configs" / "trajectories" / "turn_left_20deg_per_scan.csv", longest_gap=60.0
    )
    assert pings == pytest.approx(200)
    # The file has milliseconds: 1 in 6741 of 20 deg is 0.003 deg.
    assert times[1] == pytest.approx(pings * sonar.ping_period, abs=1e-3)
    cosine = abs(float(orientations[0] @ orientations[1]))
    assert math.degrees(2 * math.acos(cosine)) == pytest.approx(20.0)


def test_three_sonars_ride_on_one_vehicle() -> None:
    plan = check_deployment(TOP / "deploy" / "auv_three_sonars.yaml")
    kinds = sorted(task.type for task in plan.tasks if task.type.endswith("SonarTask"))
    assert kinds == ["MultibeamSonarTask", "ScanningSonarTask", "ScanningSonarTask"]


@pytest.mark.parametrize("file", sorted((TOP / "configs" / "trajectories").iterdir()), ids=lambda f: f.stem)
def test_every_trajectory_can_be_read(file: Path) -> None:
    times, positions, orientations = read_waypoints(file, longest_gap=60.0)
    assert len(times) == len(positions) == len(orientations) > 1
