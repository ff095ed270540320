"""What features cost: listed with reasons, measured on the scene, nothing where they are off."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sonar_component.scene import Body, Material, Part, World
from sonar_component.scene.shapes import plane, sphere
from sonar_component.sonars.feature_costs import FeatureCost, benchmark
from sonar_component.sonars.forward_looking import ForwardLookingSonar
from sonar_component.sonars.scanning import ScanningSonar
from sonar_component.sonars.scanning_settings import ScanningSettings
from sonar_component.sonars.settings import ForwardLookingSettings
from tests.reference.poses import pose

RELIEF = np.full((8, 8, 3), 128, np.uint8)


def scene(*materials: Material) -> World:
    bodies = [Body("floor", [Part(plane((100, 100)), Material("sand"), np.eye(4))], np.eye(4))]
    bodies[0].X_WB[2, 3] = -3
    for number, material in enumerate(materials):
        X = np.eye(4)
        X[:3, 3] = 5, number, 0
        bodies.append(Body(material.name, [Part(sphere(0.4), material, np.eye(4))], X))
    return World(bodies)


def costs_of(context: Any, world: World, **changed: Any) -> dict[str, FeatureCost]:
    sonar = ForwardLookingSonar(
        context, ForwardLookingSettings.model_validate({"range": 10, "beam_count": 16} | changed)
    )
    found = {cost.name: cost for cost in sonar.feature_costs(world, pose())}
    sonar.release()
    return found


def test_every_feature_is_listed_with_its_reason(context: Any) -> None:
    plain = costs_of(context, scene())
    assert {name for name, cost in plain.items() if cost.on} == {"WIDE_FAN", "SIGMOID"}
    assert plain["ATTENUATION"].why == "enable_attenuation is false"
    assert plain["NORMAL_MAP"].line() == (
        "normal map: off, no material has a normal map: no code, no texture, no column"
    )
    assert plain["WIDE_FAN"].line().startswith("wide fan: on, 120 deg in ")
    spotted = [Material(f"m{k}", reflectance_map=RELIEF[..., 0]) for k in range(5)]
    water: dict[str, Any] = {"enable_attenuation": True, "attenuation_properties": {"frequency": "700 kHz"}}
    everything = costs_of(context, scene(Material("rust", normal_map=RELIEF), *spotted), **water)
    assert {name for name, cost in everything.items() if not cost.on} == {"TRUTH"}
    assert everything["NORMAL_MAP"].why == "a normal map in rust"
    assert everything["REFLECTANCE_MAP"].why == "a reflectance map in m0, m1, m2 and 2 more"
    assert everything["ATTENUATION"].why.endswith(" dB/m")


def test_only_what_is_on_costs_and_it_says_how_sure_that_is(context: Any) -> None:
    for cost in costs_of(context, scene(), normalization="energy").values():
        measured = cost.whole > 0
        assert measured == cost.on
        assert 0 <= cost.cost <= cost.whole
        if not cost.on:
            assert cost.data() | {"name": "", "why": ""} == {
                "name": "", "why": "", "on": False, "cost_ms": 0, "uncertainty_ms": 0, "whole_ms": 0,
            }  # fmt: skip


def test_a_narrow_beam_is_no_wide_fan(context: Any) -> None:
    sonar = ScanningSonar(context, ScanningSettings(range=10.0))
    found = {cost.name: cost for cost in sonar.feature_costs(scene(), pose())}
    assert not found["WIDE_FAN"].on
    assert found["WIDE_FAN"].why == "3 deg in 1 view"
    sonar.release()


def test_measuring_leaves_the_image_as_it_was(context: Any) -> None:
    world = scene(Material("rust", normal_map=np.random.default_rng(1).integers(90, 166, (16, 16, 3)).astype(np.uint8)))
    sonar = ForwardLookingSonar(context, ForwardLookingSettings(range=10.0, enable_attenuation=True))
    before = sonar.ping(world, pose()).bins.copy()
    sonar.feature_costs(world, pose())
    np.testing.assert_array_equal(sonar.ping(world, pose()).bins, before)
    sonar.release()


def test_a_feature_that_was_on_leaves_no_byte_behind(context: Any) -> None:
    rows = {row["feature"]: row for row in benchmark(context, frames=1)}
    assert set(rows) == {"ATTENUATION", "NORMAL_MAP", "REFLECTANCE_MAP"}
    for row in rows.values():
        assert row["off_bytes"] == row["off_again_bytes"]
        assert min(row[f"{phase}_ms"] for phase in ("off", "on", "off_again")) > 0
    assert rows["ATTENUATION"]["on_bytes"] == rows["ATTENUATION"]["off_bytes"]
    grown = {name: row["on_bytes"] - row["off_bytes"] for name, row in rows.items()}
    pictures = 256 * 256 * 4 // 3  # with the smaller versions
    coordinates = 8 * (161 * 161 + len(sphere(1.5).vertices))
    assert grown["NORMAL_MAP"] == pytest.approx(3 * pictures + coordinates + 4, abs=4)
    assert grown["REFLECTANCE_MAP"] == pytest.approx(pictures + coordinates + 4, abs=4)
