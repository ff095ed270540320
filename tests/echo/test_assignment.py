"""Columns shared among beams, against the overlap of every column with every beam."""

from __future__ import annotations

import numpy as np
import pytest

from sonar_component.echo.assignment import Assignment, assign
from sonar_component.echo.beams import BeamTable, equal_angle, equal_sine, from_list

TALL = 0.3


def dense(assignment: Assignment, beams: int, columns: int) -> np.ndarray:
    out = np.zeros((beams, columns))
    for beam in range(beams):
        entries = slice(assignment.start[beam], assignment.start[beam + 1])
        out[beam, assignment.column[entries]] += assignment.share[entries]
    return out


def by_overlap(beams: BeamTable, right: np.ndarray, left: np.ndarray) -> np.ndarray:
    """Part of each column that lies in each beam."""
    out = np.zeros((len(beams.left), len(left)))
    for b in range(len(beams.left)):
        for c in range(len(left)):
            shared = min(beams.left[b], left[c]) - max(beams.right[b], right[c])
            out[b, c] = max(shared, 0.0) / (left[c] - right[c])
    return out


@pytest.mark.parametrize(
    "beams",
    [
        equal_angle(1, 2.0, TALL),
        equal_angle(17, 2.0, TALL),
        equal_angle(400, 2.0, TALL),  # several beams in one column
        equal_sine(33, 2.0, TALL),
        from_list(np.array([-0.9, -0.5, 0.0, 0.01, 0.85]), TALL),  # rising: beam 0 is the rightmost
    ],
    ids=["one", "some", "many", "sine", "list"],
)
def test_a_column_belongs_to_each_beam_by_its_overlap(beams: BeamTable) -> None:
    edges = np.sort(np.random.default_rng(3).uniform(-1.0, 1.0, 60))[::-1]
    left, right = edges[:-1], edges[1:]
    assignment = assign(beams, right, left)
    made = dense(assignment, len(beams.left), len(left))
    np.testing.assert_allclose(made, by_overlap(beams, right, left), atol=1e-6)  # shares are float32
    assert (assignment.share >= 0).all()


def test_beams_that_tile_the_fan_take_each_column_once() -> None:
    edges = np.linspace(1, -1, 78)
    made = dense(assign(equal_angle(31, 2.0, TALL), edges[1:], edges[:-1]), 31, 77)
    np.testing.assert_allclose(made.sum(axis=0), 1, atol=1e-6)


def test_padding_belongs_to_nobody() -> None:
    edges = np.linspace(1, -1, 11)
    left, right = np.append(edges[:-1], np.nan), np.append(edges[1:], np.nan)
    assignment = assign(equal_angle(5, 2.0, TALL), right, left)
    assert 10 not in assignment.column


def test_a_beam_that_no_column_reaches_hears_nothing() -> None:
    edges = np.linspace(0.2, -0.2, 11)
    assignment = assign(equal_angle(3, 2.0, TALL), edges[1:], edges[:-1])
    np.testing.assert_allclose(dense(assignment, 3, 10).sum(axis=1), [0, 10, 0], atol=1e-5)
