"""The clean image of a fan, whatever sonar it belongs to: layout, drawing, binning, and the truth behind each bin."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sonar_component.echo.assignment import assign
from sonar_component.echo.beams import BeamTable
from sonar_component.echo.binning import Scale, bin_footprints
from sonar_component.echo.reduction import GpuReduction
from sonar_component.echo.truth import Truth, strongest_samples
from sonar_component.gl import Context, Target, is_software
from sonar_component.render.footprints import FootprintRenderer, Optics, decode, strength_max
from sonar_component.render.layout import build_layout
from sonar_component.samples import Frame
from sonar_component.scene.world import World
from sonar_component.sonars.plan import Plan, make_plan
from sonar_component.sonars.settings import SonarSettings

_SATURATED = 0.5  # [-], share of the bins at full scale from which an image says nothing


class FanImager:
    """Renders clean images; keeps its GL program, target and tables between them.

    Use it on the thread that made the context. Call ``adopt`` to change settings or beams from the next image on.
    """

    def __init__(self, context: Context, settings: SonarSettings, beams: BeamTable) -> None:
        self._context, self._software = context, is_software(context)
        self._renderer = FootprintRenderer(context)
        self._pool = ThreadPoolExecutor(max(1, len(os.sched_getaffinity(0)) - 1), "binning")
        self.adopt(settings, beams)

    def adopt(self, settings: SonarSettings, beams: BeamTable) -> None:
        """Take settings and beams into force; tables are made anew only if the sampling changes."""
        self._settings, self.beams = settings, beams
        self.plan: Plan = make_plan(beams, settings.accuracy)
        right, left = float(beams.right.min()), float(beams.left.max())
        plan = self.plan
        self._layout = build_layout(right, left, beams.half_height, plan.column_width, plan.rows, plan.shear)
        self._assignment = assign(beams, self._layout.right, self._layout.left)
        self._solid_angle = beams.solid_angle

    def echoes(self, world: World, X_WS: NDArray[np.float64]) -> NDArray[np.float32]:
        """Clean echo strengths before gain.

        Parameters
        ----------
        X_WS : (4, 4) float64
            Pose of the sonar in the world [m].

        Returns
        -------
        (beams, bins) float32
        """
        target, scale = self._draw(world, X_WS, truth=False)
        if self._on_gpu:
            return self._reduction.bins(target.texture, self._layout, self._assignment, self._solid_angle, scale)
        pixels = target.read()
        bins, _ = bin_footprints(pixels, self._layout, self._assignment, self._solid_angle, scale, self._pool)
        return bins

    def truth(self, world: World, X_WS: NDArray[np.float64]) -> Truth:
        """What stands behind each bin of the image from that pose."""
        target, scale = self._draw(world, X_WS, truth=True)
        pixels = target.read()
        _, weight = bin_footprints(
            pixels, self._layout, self._assignment, self._solid_angle, scale, self._pool, want_weight=True
        )
        return strongest_samples(pixels, self._layout, self._assignment, scale, weight)

    def shader_image(self, time: int) -> Frame:
        """The samples of the last image: echo strength [-], range [m] and bearing [rad], float32; NaN on a miss.

        Columns run from left to right within each view, row 0 is the top.
        """
        pixels, layout = self._renderer.read(), self._layout
        strength, distance = decode(pixels, self._greatest)
        bearing = np.broadcast_to(((layout.left + layout.right) / 2).astype(np.float32)[:, None], distance.shape)
        image = np.stack([strength, distance, np.where(distance > 0, bearing, np.nan)], axis=-1)
        image[distance <= 0] = np.nan
        upright = image.transpose(1, 0, 2)[::-1]
        return Frame(time, np.ascontiguousarray(upright), "strength,range,bearing")

    def release(self) -> None:
        """Give GPU memory and threads back."""
        self._renderer.release()
        if "_reduction" in self.__dict__:
            self._reduction.release()
        self._pool.shutdown()

    def explain(self) -> list[str]:
        """What was chosen for these settings, and why, one line each."""
        layout, s = self._layout, self._settings
        features = sorted(self._renderer.features(self._optics(truth=False))) or ["none"]
        return [
            f"accuracy {s.accuracy:g}: {layout.columns} x {layout.rows} samples in {len(layout.views)} views",
            *self.plan.reasons,
            f"shader features in use: {', '.join(features).lower()}",
            f"samples become bins on the {'graphics card' if self._on_gpu else 'CPU'}: "
            f"the driver draws on the {'CPU' if self._software else 'card'}",
        ]

    def remarks(self, bins: NDArray[np.float32]) -> list[str]:
        """Why an image is black or white, in words; empty for a good one."""
        if self._renderer.geometry.empty:
            return ["the scene has no triangles: the image is empty"]
        if not bins.any():
            return [f"no surface lies in the sector within {self._settings.range:g} m: the image is black"]
        if float((bins >= 1.0).mean()) > _SATURATED:
            return [f"more than {_SATURATED:.0%} of the bins are at full scale: lower the gain"]
        return []

    def _optics(self, truth: bool) -> Optics:
        s = self._settings
        attenuation = s.attenuation_properties.nepers_per_metre() if s.enable_attenuation else 0.0
        return Optics(s.range, s.range / s.bin_count, s.sigmoid, attenuation, truth)

    def _draw(self, world: World, X_WS: NDArray[np.float64], truth: bool) -> tuple[Target, Scale]:
        s = self._settings
        self._renderer.geometry.update(world)
        optics = self._optics(truth)
        target = self._renderer.draw(X_WS, self._layout, optics)
        self._greatest = strength_max(optics, self._renderer.geometry.reflectance_max)
        return target, Scale(s.bin_count, s.range, s.min_range, self._greatest, s.normalization == "mean")

    @property
    def _on_gpu(self) -> bool:
        wanted = self._settings.reduction
        return wanted == "gpu" or (wanted == "auto" and not self._software)

    @cached_property
    def _reduction(self) -> GpuReduction:
        return GpuReduction(self._context)
