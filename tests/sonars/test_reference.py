"""The converged reference against closed forms, and the images of the original's scene against the reference."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sonar_component.scene.shapes import sphere
from sonar_component.sonars import reference
from sonar_component.sonars.reference import Errors, Sums, converged, errors
from sonar_component.sonars.settings import ForwardLookingSettings
from tests.reference import closed_forms
from tests.reference.poses import pose
from tests.reference.scenes import STANDARD, floor, wall, world

DEG = np.pi / 180


@pytest.fixture
def embree() -> None:
    pytest.importorskip("embreex", reason="the converged reference needs the extra sonar-component[reference]")


def integrals(scene: Any, at: Any = None, **settings: Any) -> Sums:
    s = ForwardLookingSettings(**settings)
    return converged(scene, (at or pose()).transform(), s.beam_table(), s.range, s.bin_count, closed_forms.sigmoid)


@pytest.mark.usefixtures("embree")
def test_the_reference_of_a_wall_is_its_closed_form() -> None:
    settings: dict[str, Any] = {"range": 10.0, "bin_count": 100, "beam_count": 8, "beam_width": 60 * DEG}
    made, table = integrals(world(wall(5.0)), **settings), ForwardLookingSettings(**settings).beam_table()
    truth = closed_forms.wall_energy(table.bearings, table.right, table.left, table.half_height)
    np.testing.assert_allclose(made.relative_energy().sum(axis=1), truth, rtol=1e-3)  # what doublings agree to
    np.testing.assert_allclose(made.solid_angle.sum(axis=1), table.solid_angle, rtol=1e-6)
    assert made.mean().max() == pytest.approx(closed_forms.sigmoid(1.0), abs=2e-3)


@pytest.mark.usefixtures("embree")
def test_the_reference_of_a_flat_bottom_is_its_closed_form() -> None:
    settings: dict[str, Any] = {"range": 20.0, "bin_count": 100, "beam_count": 2, "beam_width": 10 * DEG}
    made = integrals(world(floor(2.0)), **settings).relative_energy()
    truth = closed_forms.flat_bottom(2.0, 10 * DEG, np.linspace(0, 20, 101))
    assert np.linalg.norm(made - truth) <= 2e-3 * np.linalg.norm(np.broadcast_to(truth, made.shape))
    np.testing.assert_allclose(made[:, 60:], np.broadcast_to(truth[60:], (2, 40)), rtol=0.01)  # bins near the end too


@pytest.mark.usefixtures("embree")
def test_the_reference_of_a_ball_is_its_closed_form() -> None:
    settings: dict[str, Any] = {"range": 10.0, "bin_count": 50, "beam_count": 8, "beam_width": 20 * DEG}
    made = integrals(world((sphere(0.5, 1e-4), (5.0, 0, 0))), **settings)
    truth = closed_forms.sphere_profile(0.5, 5.0, np.linspace(0, 10, 51))
    assert np.linalg.norm(made.energy.sum(axis=0) - truth) <= 3e-3 * np.linalg.norm(
        truth
    )  # facets of 0.1 mm and the doublings


@pytest.mark.usefixtures("embree")
def test_the_original_scene_at_default_settings_is_within_the_stated_errors(
    ping: Any, monkeypatch: pytest.MonkeyPatch, record_testsuite_property: Any
) -> None:
    """256 beams of 500 bins over 120 x 20 deg, default accuracy: floor, ball and box of the original's frames."""
    # Doublings that agree to 0.003 take 5 s instead of 40 s and leave a sixth of what is allowed below.
    monkeypatch.setattr(reference, "AGREEMENT", 0.003)
    settings: dict[str, Any] = {"range": 30.0, "bin_count": 500, "beam_count": 256}
    at, scene = pose((0, 0, 3), (0, 15, 0)), world(*STANDARD)
    truth = integrals(scene, at, **settings)
    energy, mean = (ping(scene, at, normalization=n, **settings).bins for n in ("energy", "mean"))
    made = errors(truth, energy.astype(float), mean.astype(float))
    for name, value in vars(made).items():
        record_testsuite_property(f"original scene, {name}", value)
    assert made.energy <= 0.02
    assert made.mean <= 0.02
    assert made.missed <= 0.005
    assert made.false <= 0.001


def test_errors_are_those_that_are_stated() -> None:
    ones = np.ones((2, 4))
    truth = Sums(ones * [1, 1, 0, 1e-6], ones * [0.5, 0.2, 0, 0], ones * [0.4, 0.1, 0, 0], beam=np.ones(2))
    exact = errors(truth, truth.relative_energy(), truth.mean())
    assert (exact.energy, exact.mean, exact.missed, exact.false) == (0, 0, 0, 0)
    E, mean = truth.relative_energy().copy(), truth.mean().copy()
    E[0, 0] = 0.0
    mean[0, 1], mean[1, 2] = 0.0, 0.5
    made = errors(truth, E, mean)
    assert made.energy == pytest.approx(0.5 / np.sqrt(2 * (0.25 + 0.04)))
    assert made.mean == pytest.approx(0.1 / np.sqrt(2 * (0.16 + 0.01)))
    assert made == Errors(made.energy, made.mean, missed=0.25, false=0.5)


def test_neighbouring_bins_and_beams_add_up() -> None:
    rng = np.random.default_rng(2)
    fine = Sums(*(rng.random((6, 8)) for _ in range(3)), beam=np.arange(6.0))
    coarse = fine.coarser(beams=3, bins=4)
    assert coarse.energy.shape == (2, 2)
    assert coarse.energy[1, 0] == pytest.approx(fine.energy[3:, :4].sum())
    assert coarse.beam.tolist() == [3.0, 12.0]


def test_without_embree_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "embreex.mesh_construction", None)
    with pytest.raises(RuntimeError, match=r"pip install .sonar-component\[reference\]"):
        integrals(world(wall(5.0)), range=10.0, bin_count=10, beam_count=1)
