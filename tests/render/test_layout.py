"""Where samples lie: every beam covered, every cell worth its solid angle inside the aperture."""

from __future__ import annotations

import numpy as np
import pytest

from sonar_component.render.layout import MAX_VIEW, MOST_VIEWS, Layout, build_layout

DEG = np.pi / 180
# width of the fan, aperture, width of a column, rows, shear
SHAPES = [
    (120 * DEG, 20 * DEG, 0.12 * DEG, 64, 0.25),
    (1 * DEG, 20 * DEG, 0.25 * DEG, 32, 0.5),
    (3 * DEG, 35 * DEG, 1.0 * DEG, 48, 0.5),
    (130 * DEG, 12 * DEG, 0.06 * DEG, 24, 0.125),
    (359 * DEG, 20 * DEG, 1.0 * DEG, 24, 0.5),
    (360 * DEG, 150 * DEG, 2.0 * DEG, 180, 0.0),
    (90 * DEG, 120 * DEG, 0.5 * DEG, 100, 0.25),
    (60 * DEG, 0.1 * DEG, 0.25 * DEG, 4, 0.5),
]


@pytest.fixture(params=SHAPES, ids=lambda s: f"{s[0] / DEG:.0f}x{s[1] / DEG:g}")
def shape(request: pytest.FixtureRequest) -> tuple[float, float, float, int, float]:
    return request.param  # type: ignore[no-any-return]


@pytest.fixture
def layout(shape: tuple[float, float, float, int, float]) -> Layout:
    width, height, column_width, rows, shear = shape
    return build_layout(-width / 2, width / 2, height / 2, column_width, rows, shear)


def test_columns_tile_the_fan_from_left_to_right(layout: Layout, shape: tuple[float, ...]) -> None:
    assert layout.left[0] == pytest.approx(shape[0] / 2, abs=1e-12)
    assert layout.right[-1] == pytest.approx(-shape[0] / 2, abs=1e-12)
    np.testing.assert_allclose(layout.right[:-1], layout.left[1:], atol=1e-12)
    assert (layout.left > layout.right).all()


def test_no_column_is_wider_than_asked_for(layout: Layout, shape: tuple[float, ...]) -> None:
    assert (layout.left - layout.right).max() <= shape[2] * (1 + 1e-9)


def test_the_cells_of_a_column_are_worth_its_whole_sector(layout: Layout, shape: tuple[float, ...]) -> None:
    sector = (layout.left - layout.right) * 2 * np.sin(shape[1] / 2)
    # Cells are float32, 6e-8 of each.
    np.testing.assert_allclose(layout.solid_angle.sum(axis=1, dtype=np.float64), sector, rtol=1e-6)


def test_a_cell_is_worth_what_it_covers_inside_the_aperture(layout: Layout, shape: tuple[float, ...]) -> None:
    """Against points strewn over the cells of the first view: a count of those inside, with the Jacobian of a plane."""
    view, half = layout.views[0], shape[1] / 2
    rng = np.random.default_rng(0)
    for column in np.unique(np.linspace(0, view.columns - 1, 5).astype(int)):
        y_low = view.column_bottoms()[column] + np.arange(layout.rows) * view.y_step
        x = view.x_left + (column + rng.random((layout.rows, 4000))) * view.x_step
        y = y_low[:, None] + rng.random((layout.rows, 4000)) * view.y_step
        inside = np.abs(np.arctan(y / np.sqrt(1 + x * x))) < half
        jacobian = (1 + x * x + y * y) ** -1.5  # d(solid angle) / d(area) of a plane at depth 1
        counted = (inside * jacobian).mean(axis=1) * view.x_step * view.y_step
        # 4000 points: 3 sigma of a share is at most 2.4 % of a cell; the table takes each column's bearing as one,
        # which bends the aperture's edge by some per cent of a cell more.
        whole = view.x_step * view.y_step * jacobian.max()
        np.testing.assert_allclose(layout.solid_angle[column], counted, atol=0.08 * whole)


def test_rows_outside_the_aperture_are_worth_nothing_and_rows_inside_are_in_use(layout: Layout) -> None:
    rows = np.arange(layout.rows)[None, :]
    used = (rows >= layout.first_row[:, None]) & (rows <= layout.last_row[:, None])
    whole = layout.solid_angle.max(axis=1, keepdims=True)
    assert (layout.solid_angle[~used] <= 1e-6 * np.broadcast_to(whole, used.shape)[~used]).all()
    assert (layout.solid_angle[used] >= 0).all()
    assert (layout.last_row > layout.first_row).all()


def test_what_is_clipped_is_what_the_edge_cells_lack(layout: Layout) -> None:
    columns = np.arange(layout.columns)
    assert (layout.first_clip >= 0).all()
    assert (layout.last_clip <= 1).all()
    for row, clip, inward in ((layout.first_row, layout.first_clip, 1), (layout.last_row, layout.last_clip, -1)):
        edge, inner = (layout.solid_angle[columns, row + n * inward] for n in (0, 1))
        enough = layout.last_row - layout.first_row >= 4
        # A cell's solid angle goes with cos^3 of its elevation: neighbours differ by 2 / rows times its tangent.
        tall = np.tan(layout.half_height)
        close = 0.02 + 3 * tall * np.maximum(tall, 1) / layout.rows * 2
        np.testing.assert_allclose((edge / inner)[enough], (1 - clip)[enough], atol=close)


def test_views_are_narrow_and_not_too_many(layout: Layout) -> None:
    assert len(layout.views) <= MOST_VIEWS
    assert all(2 * view.half_width <= MAX_VIEW + 1e-9 for view in layout.views)
    assert sum(view.columns for view in layout.views) == layout.columns == len(layout.right)
    assert [view.first_column for view in layout.views] == (
        np.cumsum([0] + [view.columns for view in layout.views])[:-1].tolist()
    )


def test_every_column_covers_the_aperture(layout: Layout, shape: tuple[float, ...]) -> None:
    for view in layout.views:
        edge = np.tan(shape[1] / 2) * np.sqrt(1 + view.column_centres() ** 2)
        bottom = view.column_bottoms()
        assert (bottom <= -edge + 1e-9).all()
        assert (bottom + view.rows * view.y_step >= edge - 1e-9).all()


def test_elevations_are_those_of_the_cells_centres(layout: Layout) -> None:
    elevation = layout.elevations()
    assert elevation.shape == (layout.columns, layout.rows)
    assert (np.diff(elevation, axis=1) > 0).all()
    columns = np.arange(layout.columns)
    assert (np.abs(elevation[columns, layout.first_row + 1]) < layout.half_height + 1e-9).all()


def test_a_sector_off_the_axis_is_covered_too() -> None:
    layout = build_layout(2.0, 4.0, 0.2, 0.01, 32, 0.25)
    assert (layout.right[-1], layout.left[0]) == pytest.approx((2.0, 4.0))
