from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sonar_component.middleware import connect, run_once
from sonar_component.middleware.clock import SteppedClock
from sonar_component.middleware.deployment import check_deployment
from sonar_component.samples import Sonar
from sonar_component.settings import SettingsErrors
from sonar_component.tasks.driver_stand_in import DriverStandInTask, MicronStandInTask
from sonar_component.tasks.scanning_sonar import ScanningSonarProperties

DEPLOY = Path(__file__).parents[2] / "deploy"
CONTRACT = DEPLOY / "driver_contract.yaml"
MICRON = DEPLOY / "driver_contract_micron.yaml"


def image(**properties: Any) -> Sonar:
    task = DriverStandInTask("driver", properties)
    (sample,) = run_once(task)["sonar_samples"]
    assert isinstance(sample, Sonar)
    return sample


@pytest.mark.parametrize("beam_width", ["120 deg", "350 deg", "1 deg"])
def test_the_wall_lies_where_geometry_puts_it(beam_width: str) -> None:
    sonar = image(beam_width=beam_width, beam_count=64, bin_count=300)
    sonar.validate()
    beams, bins = np.nonzero(sonar.bins)
    across = sonar.bin_ranges()[bins] * np.cos(sonar.bearings[beams])
    # The middle of a bin is at most half a bin of range from the echo.
    assert np.abs(across - DriverStandInTask.WALL).max() <= sonar.bin_length / 2
    assert len(beams) == np.count_nonzero(np.cos(sonar.bearings) > DriverStandInTask.WALL / 30)


def test_gain_scales_as_rocks_does() -> None:
    assert image(gain=0.35).bins.max() == np.float32(0.7)  # 0.5 is unity


@pytest.mark.parametrize(
    ("contract", "driver", "simulator"),
    [(CONTRACT, "DriverStandInTask", "MultibeamSonarTask"), (MICRON, "MicronStandInTask", "ScanningSonarTask")],
)
def test_driver_and_simulator_change_places_by_their_type_alone(
    tmp_path: Path, contract: Path, driver: str, simulator: str
) -> None:
    text = contract.read_text()
    for old, new in ((driver, simulator), (simulator, driver)):
        swapped = tmp_path / f"{new}.yaml"
        swapped.write_text(
            "\n".join(f"    type: {new}" if line == f"    type: {old}" else line for line in text.split("\n"))
        )
        types = {task.name: task.type for task in check_deployment(swapped).tasks}
        assert (types["driver"], types["simulator"]) == (new, new)


def test_both_give_frames_of_one_shape(graph: Any) -> None:
    text = CONTRACT.read_text().split("  viewer:")[0]
    graph.start(text)
    shapes, fans = [], []
    for task in ("driver", "simulator"):
        with connect(f"{task}.sonar_samples", Sonar, timeout=60.0) as port:
            sonar = port.read()
            shapes.append(sonar.bins.shape)
            fans.append((sonar.bin_length, sonar.beam_width, sonar.bearings[0]))
    assert shapes[0] == shapes[1]
    assert fans[0] == pytest.approx(fans[1])  # the same closed forms, in float64


def beams(count: int, **config: Any) -> list[Sonar]:
    clock = SteppedClock(1_000_000)
    task = MicronStandInTask("driver", {"config": config}, clock=clock)
    return [beam for _ in range(count) for beam in run_once(task)["sonar_samples"]]


def test_the_microns_wall_lies_where_geometry_puts_it() -> None:
    found = beams(25, angular_resolution="5 deg", left_limit="60 deg", right_limit="-60 deg", continous=False)
    for beam in found:
        beam.validate()
        (echo,) = np.nonzero(beam.bins[0])
        across = beam.bin_ranges()[echo] * np.cos(beam.bearings[0])
        seen = MicronStandInTask.WALL / np.cos(beam.bearings[0]) < 15.0  # [m], max_distance by default
        assert len(echo) == seen
        assert np.abs(across - MicronStandInTask.WALL).max(initial=0.0) <= beam.bin_length / 2 + 1e-9  # rounding


def test_the_microns_head_goes_back_and_forth_or_on_and_on() -> None:
    sector = beams(7, angular_resolution="30 deg", left_limit="30 deg", right_limit="-30 deg", continous=False)
    assert np.degrees([b.bearings[0] for b in sector]) == pytest.approx([-30, 0, 30, 30, 0, -30, -30], abs=1e-9)
    turn = beams(5, angular_resolution="90 deg")
    assert np.cos([b.bearings[0] for b in turn]) == pytest.approx([1, 0, -1, 0, 1], abs=1e-9)


def test_the_microns_words_mean_the_same_to_the_simulator() -> None:
    config = {"max_distance": "30 m", "resolution": "0.2 m", "angular_resolution": "1.8 deg", "left_limit": "60 deg"}
    found = ScanningSonarProperties.model_validate({"config": {**config, "right_limit": "-45 deg"}, "gain": 0.7})
    assert (found.range, found.min_range, found.bin_count, found.gain) == (30.0, 1.0, 150, 0.7)  # beside it wins
    assert np.degrees([found.left_limit, found.right_limit, found.motor_step]) == pytest.approx([-45, 60, 1.8])
    assert (found.continuous, found.speed_of_sound) == (True, 1500.0)


def test_a_mistake_in_the_structure_is_told_at_its_place(tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text(MICRON.read_text().replace("continous", "continuous"), encoding="utf-8")
    with pytest.raises(SettingsErrors, match=r"wrong.yaml:19:95: .*continuous.*continous"):
        check_deployment(wrong)


def test_micron_and_simulator_give_beams_of_one_shape(graph: Any) -> None:
    graph.start(MICRON.read_text().split("  viewer:")[0])
    found = []
    for task in ("driver", "simulator"):
        with connect(f"{task}.sonar_samples", Sonar, timeout=60.0) as port:
            beam = port.read()
            found.append((*beam.bins.shape, beam.bin_length))
            assert abs(beam.bearings[0]) <= np.radians(60.0) + 1e-9
    assert found[0] == pytest.approx(found[1])
