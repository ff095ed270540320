"""The known target of `sonar doctor`: it passes here, and it fails when the picture is wrong."""

from __future__ import annotations

from typing import Any

import pytest

from sonar_component.sonars import self_test
from tests.reference.scenes import wall, world


def test_the_known_target_is_heard_as_its_closed_form(context: Any) -> None:
    checks = self_test.known_target(context)
    assert [what for what, _, _ in checks] == ["range", "energy"]
    assert all(passed for _, passed, _ in checks), checks


@pytest.mark.parametrize("distance", [5.9, 6.1])
def test_a_target_elsewhere_is_noticed(context: Any, monkeypatch: pytest.MonkeyPatch, distance: float) -> None:
    monkeypatch.setattr(self_test, "wall_ahead", lambda _: world(wall(distance)))
    (_, passed, words), _ = self_test.known_target(context)
    assert not passed
    assert "bins off" in words


def test_a_loss_of_energy_is_noticed(context: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from sonar_component.scene import Material

    monkeypatch.setattr(self_test, "wall_ahead", lambda d: world(wall(d), material=Material("dull", 0.97)))
    (_, near, _), (_, loud, _) = self_test.known_target(context)
    assert near
    assert not loud
