"""The two ways that ours is measured against, on the same renderer: one range per sample, and one perspective image.

Both put the whole of a sample into one bin, as the original simulator and its successors do.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sonar_component.echo.assignment import Assignment, assign
from sonar_component.echo.beams import BeamTable
from sonar_component.echo.binning import Scale, bin_footprints
from sonar_component.gl import Context
from sonar_component.render.footprints import FootprintRenderer, Optics, strength_max
from sonar_component.render.layout import Layout, View, build_layout, with_tables
from sonar_component.scene.world import World
from sonar_component.sonars.settings import SonarSettings

Array = NDArray[np.float64]

_PAPER_PIXELS_PER_BIN = 5.12  # [-], of the original implementation
_RANGE_ONLY = np.uint32(0x0000FFFF)  # what is kept of a sample's code: its strength, not its span of ranges


class PointSampler:
    """Renders with samples that have a range and no span.

    Use it on the thread that made the context.
    """

    def __init__(self, context: Context, settings: SonarSettings, beams: BeamTable, layout: Layout) -> None:
        self._renderer = FootprintRenderer(context)
        self._settings, self._beams, self.layout = settings, beams, layout
        self._assignment: Assignment = assign(beams, layout.right, layout.left)

    def image(self, world: World, X_WS: Array, mean: bool) -> NDArray[np.float32]:
        """Mean or energy image, (beams, bins) float32."""
        s = self._settings
        self._renderer.geometry.update(world)
        optics = Optics(s.range, s.range / s.bin_count, (s.sigmoid_slope, s.sigmoid_centre) if mean else None)
        pixels = self._renderer.draw(X_WS, self.layout, optics).read()
        pixels[:, :, 1] &= _RANGE_ONLY
        greatest = strength_max(optics, self._renderer.geometry.reflectance_max)
        scale = Scale(s.bin_count, s.range, s.min_range, greatest, mean)
        bins, _ = bin_footprints(pixels, self.layout, self._assignment, self._beams.solid_angle, scale)
        return bins

    def release(self) -> None:
        """Give GPU memory back."""
        self._renderer.release()


def one_range_per_sample(
    context: Context, settings: SonarSettings, beams: BeamTable, columns: int, rows: int
) -> PointSampler:
    """The exact sector on a regular grid of `columns` per beam and `rows`."""
    width = float(np.min(beams.left - beams.right)) / columns
    layout = build_layout(float(beams.right.min()), float(beams.left.max()), beams.half_height, width, rows)
    return PointSampler(context, settings, beams, layout)


def paper_perspective(
    context: Context, settings: SonarSettings, beams: BeamTable, per_bin: float = _PAPER_PIXELS_PER_BIN
) -> PointSampler:
    """One perspective image over the whole fan, every pixel worth the same: the paper's way, at its own size.

    Raises
    ------
    ValueError
        If the fan is 180 deg or wider: no perspective image covers it.
    """
    half = float(beams.left.max() - beams.right.min()) / 2
    if half >= np.pi / 2 - 1e-6:
        raise ValueError("one perspective image cannot cover 180 deg or more")
    columns = int(settings.bin_count * per_bin)
    step = 2 * np.tan(half) / columns
    rows = max(1, int(columns * np.tan(beams.half_height) / np.tan(half)))
    middle = float(beams.left.max() + beams.right.min()) / 2
    y_step = 2 * np.tan(beams.half_height) / rows
    view = View(middle, half, 0, columns, rows, -np.tan(half), step, y_step, 0.0)
    layout = with_tables((view,), rows, beams.half_height)
    alike = np.full_like(layout.solid_angle, float(beams.solid_angle.sum()) / layout.solid_angle.size)
    nothing = np.zeros_like(layout.first_clip)
    whole = (np.zeros_like(layout.first_row), np.full_like(layout.last_row, rows - 1))
    layout = replace(
        layout, solid_angle=alike, first_row=whole[0], last_row=whole[1], first_clip=nothing, last_clip=nothing
    )
    return PointSampler(context, settings, beams, layout)
