"""The benchmark of loading: it writes the world that it says, and measures a real process."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sonar_component.scene import load_world
from sonar_component.sonars.load_cost import KINDS, load_costs, write_floor


@pytest.mark.parametrize("kind", KINDS)
def test_each_file_holds_the_same_floor(tmp_path: Path, kind: str) -> None:
    path, count, size = write_floor(tmp_path, kind, 5000)
    assert count == 2 * 50 * 50
    assert 0 < size < 1e6
    (body,) = load_world(path).bodies.values()
    (part,) = body.parts
    assert len(part.mesh.faces) == count
    points = (part.mesh.vertices + part.X_BM[:3, 3])[part.mesh.faces].reshape(-1, 3)
    np.testing.assert_allclose(np.abs(points).max(axis=0)[:2], 100, atol=1e-4)  # float32 of 100 m
    assert 0.8 < points[:, 2].max() < 1.1


def test_a_world_is_loaded_in_a_process_of_its_own_and_measured(context: Any) -> None:
    (row,) = load_costs(5000, kinds=("ply",))
    assert row["triangles"] == 5000
    assert all(row[key] > 0 for key in ("load_s", "describe_s", "upload_s"))
    assert row["peak_mb"] >= row["held_mb"] - 0.1  # pages are counted in batches
    # Position and normal of each vertex, three corners of each triangle.
    assert row["gpu_mb"] == pytest.approx((51 * 51 * 24 + 5000 * 12) / 1e6)
