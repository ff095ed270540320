from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sonar_component.middleware import connect, run_once
from sonar_component.middleware.deployment import check_deployment
from sonar_component.samples import Sonar
from sonar_component.tasks.driver_stand_in import DriverStandInTask

CONTRACT = Path(__file__).parents[2] / "deploy" / "driver_contract.yaml"


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


def test_driver_and_simulator_change_places_by_their_type_alone(tmp_path: Path) -> None:
    text = CONTRACT.read_text()
    for old, new in (("DriverStandInTask", "MultibeamSonarTask"), ("MultibeamSonarTask", "DriverStandInTask")):
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
