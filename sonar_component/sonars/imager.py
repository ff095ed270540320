"""The clean image of a fan, whatever sonar it belongs to: layout, drawing, binning, and the truth behind each bin."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sonar_component.echo.assignment import Assignment, assign
from sonar_component.echo.beams import BeamTable
from sonar_component.echo.binning import Scale, bin_footprints
from sonar_component.echo.reduction import GpuReduction
from sonar_component.echo.truth import Truth, strongest_samples
from sonar_component.gl import Context, Target, is_software
from sonar_component.render.footprints import FootprintRenderer, Optics, decode, strength_max
from sonar_component.render.layout import Layout, build_layout
from sonar_component.samples import Frame
from sonar_component.scene.world import World
from sonar_component.sonars.plan import START, Plan, choose_level, highest_level, plan_at
from sonar_component.sonars.settings import SonarSettings

Pose = NDArray[np.float64]  # (4, 4) [m]

_PLANNED_FOR = ("range", "min_range", "bin_count", "accuracy", "enable_attenuation", "attenuation_properties")
# [images], until a plan is checked against the scene as it is seen then: the sooner the less an image costs, since a
# look takes several and would be felt as a stall where they are dear; and coarse plans, which see least, are cheap.
_IMAGES_PER_NS, _SOONEST, _LATEST = 3e-5, 32, 1024
_MOVED, _TURNED = 0.05, np.radians(5.0)  # [-] of the range, [rad], since the last look: below that nothing is new
_TRIANGLE, _SAMPLE = 120.0, 15.0  # [ns] of processor time on llvmpipe; to a card neither is dear
_SATURATED = 0.5  # [-], share of the bins at full scale from which an image says nothing


@dataclass(frozen=True)
class _Tables:
    """What depends on beams and plan alone."""

    plan: Plan
    layout: Layout
    assignment: Assignment


def _same(a: BeamTable, b: BeamTable) -> bool:
    edges = all(np.array_equal(x, y) for x, y in ((a.right, b.right), (a.left, b.left)))
    return edges and a.half_height == b.half_height


class FanImager:
    """Renders clean images; keeps its GL program, target and tables between them.

    Use it on the thread that made the context. Call ``adopt`` to change settings or beams from the next image on.

    Parameters
    ----------
    plan_poses : function of the pose of an image -> poses
        From where the samples are planned: a beam that turns must not be planned for the one direction it looks in.
    """

    def __init__(
        self,
        context: Context,
        settings: SonarSettings,
        beams: BeamTable,
        plan_poses: Callable[[Pose], Sequence[Pose]] = lambda X_WS: (X_WS,),
    ) -> None:
        self._plan_poses = plan_poses
        self._context, self._software = context, is_software(context)
        self._renderer = FootprintRenderer(context)
        self._level, self._due, self._stale = START, 0, True
        self._planned_from: tuple[Pose, int] = (np.eye(4), 0)
        self._tables: dict[tuple[int, bool], _Tables] = {}
        self._wide = False
        self._planned_for: tuple[World, int] | None = None
        self.estimated_error = float("nan")
        # Two processors are often the two threads of one core, where a second worker gained nothing.
        others = len(os.sched_getaffinity(0)) - 1
        self._pool = ThreadPoolExecutor(others, "binning") if others > 1 else None
        self._settings, self.beams, self._solid_angle = settings, beams, beams.solid_angle

    def adopt(self, settings: SonarSettings, beams: BeamTable) -> None:
        """Take settings and beams into force; the samples are planned anew at the next image if it matters."""
        same_beams = _same(beams, self.beams)
        if not same_beams:
            self.beams, self._solid_angle, self._tables = beams, beams.solid_angle, {}
        if not same_beams or any(getattr(self._settings, name) != getattr(settings, name) for name in _PLANNED_FOR):
            self._stale = True
        self._settings = settings

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
        self._plan_if_due(world, X_WS)
        return self._image(world, X_WS, self._table(self._level), self._settings.normalization == "mean")

    def _image(self, world: World, X_WS: NDArray[np.float64], tables: _Tables, mean: bool) -> NDArray[np.float32]:
        target, scale = self._draw(world, X_WS, tables, self._optics(mean), mean)
        if self._on_gpu:
            return self._reduction.bins(target.texture, tables.layout, tables.assignment, self._solid_angle, scale)
        bins, _ = bin_footprints(target.read(), tables.layout, tables.assignment, self._solid_angle, scale, self._pool)
        return bins

    def _plan_if_due(self, world: World, X_WS: NDArray[np.float64]) -> None:
        geometry = (world, world.geometry_version)
        if geometry == self._planned_for and not self._stale:
            self._due -= 1
            if self._due > 0 or not self._elsewhere(world, X_WS):
                return
        in_use = self._level if geometry == self._planned_for else None
        self._planned_for, self._planned_from, self._stale = geometry, (X_WS.copy(), world.pose_version), False
        poses = self._plan_poses(X_WS)
        if in_use is None:
            self._renderer.geometry.update(world)
            start = min(START, highest_level(self.beams))
            self._wide = self._cost(poses[0], True, start) < self._cost(poses[0], False, start)
        self._level, self.estimated_error = choose_level(
            lambda level: np.concatenate([self._image(world, X, self._table(level), mean=False) for X in poses]),
            self._settings.accuracy,
            highest_level(self.beams),
            in_use,
        )
        if self.estimated_error == 0.0:  # nothing was seen, which is no reason to look less closely
            self._level = min(START, highest_level(self.beams))
        patience = np.clip(_IMAGES_PER_NS * self._cost(poses[0], self._wide, self._level), _SOONEST, _LATEST)
        self._due = int(patience) * len(poses)

    def _elsewhere(self, world: World, X_WS: Pose) -> bool:
        """Whether the sonar or a body has moved since the last look."""
        X_before, bodies = self._planned_from
        away = float(np.linalg.norm(X_WS[:3, 3] - X_before[:3, 3]))
        turned = (float((X_WS[:3, :3] * X_before[:3, :3]).sum()) - 1) / 2  # cosine of the angle
        return away > _MOVED * self._settings.range or turned < np.cos(_TURNED) or world.pose_version != bodies

    def _cost(self, X_WS: Pose, wide: bool, level: int) -> float:
        """Rough cost of an image in wide or narrow views [ns]."""
        layout = self._table(level, wide).layout
        drawn = self._renderer.triangles(X_WS, layout, self._optics(mean=False))
        return _TRIANGLE * drawn + _SAMPLE * layout.columns * layout.rows

    def _table(self, level: int, wide: bool | None = None) -> _Tables:
        wide = self._wide if wide is None else wide
        if (level, wide) not in self._tables:
            plan = plan_at(self.beams, level)
            right, left = float(self.beams.right.min()), float(self.beams.left.max())
            layout = build_layout(right, left, self.beams.half_height, plan.column_width, plan.rows, plan.shear, wide)
            self._tables[level, wide] = _Tables(plan, layout, assign(self.beams, layout.right, layout.left))
        return self._tables[level, wide]

    def truth(self, world: World, X_WS: NDArray[np.float64]) -> Truth:
        """What stands behind each bin of the image from that pose."""
        self._plan_if_due(world, X_WS)
        tables, mean = self._table(self._level), self._settings.normalization == "mean"
        target, scale = self._draw(world, X_WS, tables, replace(self._optics(mean), truth=True), mean)
        pixels = target.read()
        _, weight = bin_footprints(
            pixels, tables.layout, tables.assignment, self._solid_angle, scale, self._pool, want_weight=True
        )
        return strongest_samples(pixels, tables.layout, tables.assignment, scale, weight)

    def shader_image(self, time: int) -> Frame:
        """The samples of the last image: echo strength [-], range [m] and bearing [rad], float32; NaN on a miss.

        Columns run from left to right within each view, row 0 is the top.
        """
        pixels, layout = self._renderer.read(), self._table(self._level).layout
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
        if self._pool is not None:
            self._pool.shutdown()

    def explain(self) -> list[str]:
        """What was chosen for the last image, and why, one line each."""
        layout, s = self._table(self._level).layout, self._settings
        per_beam = float(np.mean(self.beams.left - self.beams.right) / np.mean(layout.left - layout.right))
        return [
            f"{layout.columns} x {layout.rows} samples in {len(layout.views)} views: {per_beam:.1f} columns per beam",
            f"estimated energy error {self.estimated_error:.4f} for accuracy {s.accuracy:g}, "
            "from the difference to finer samples of this scene",
            f"samples become bins on the {'graphics card' if self._on_gpu else 'CPU'}: "
            f"the driver draws on the {'CPU' if self._software else 'card'}",
        ]

    @property
    def settings(self) -> SonarSettings:
        """Settings in force."""
        return self._settings

    @property
    def view_count(self) -> int:
        """Perspective views that the last image was drawn in."""
        return len(self._table(self._level).layout.views)

    @property
    def features(self) -> frozenset[str]:
        """What the program of the last image held besides the bare samples, by #define."""
        optics = self._optics(self._settings.normalization == "mean")
        return frozenset(self._renderer.features(optics, self.view_count))

    def seconds(self, world: World, X_WS: Pose, *without: str) -> float:
        """How long it takes to draw and read the samples of an image, with features left out that are in use."""
        began = time.perf_counter()
        self._plan_if_due(world, X_WS)
        mean = self._settings.normalization == "mean"
        target, _ = self._draw(
            world, X_WS, self._table(self._level), replace(self._optics(mean), without=without), mean
        )
        target.read()
        return time.perf_counter() - began

    @property
    def gpu_bytes(self) -> int:
        """What the world takes in GPU memory, with one draw of one tile."""
        g = self._renderer.geometry
        return g.columns.itemsize + (g.loaded.bytes if g.loaded is not None else 0)

    def remarks(self, bins: NDArray[np.float32]) -> list[str]:
        """Why an image is black or white, in words; empty for a good one."""
        if self._renderer.geometry.empty:
            return ["the scene has no triangles: the image is empty"]
        if not bins.any():
            return [f"no surface lies in the sector within {self._settings.range:g} m: the image is black"]
        if float((bins >= 1.0).mean()) > _SATURATED:
            return [f"more than {_SATURATED:.0%} of the bins are at full scale: lower the gain"]
        return []

    def _optics(self, mean: bool) -> Optics:
        s = self._settings
        attenuation = s.attenuation_properties.nepers_per_metre() if s.enable_attenuation else 0.0
        # A planner's energy image of a sonar with the paper's mean has no use for the sigmoid.
        sigmoid = s.sigmoid if mean == (s.normalization == "mean") else None
        return Optics(s.range, s.range / s.bin_count, sigmoid, attenuation)

    def _draw(
        self, world: World, X_WS: NDArray[np.float64], tables: _Tables, optics: Optics, mean: bool
    ) -> tuple[Target, Scale]:
        s = self._settings
        self._renderer.geometry.update(world)
        target = self._renderer.draw(X_WS, tables.layout, optics)
        self._greatest = strength_max(optics, self._renderer.geometry.reflectance_max)
        return target, Scale(s.bin_count, s.range, s.min_range, self._greatest, mean, linear=optics.sigmoid is None)

    @property
    def _on_gpu(self) -> bool:
        wanted = self._settings.reduction
        return wanted == "gpu" or (wanted == "auto" and not self._software)

    @cached_property
    def _reduction(self) -> GpuReduction:
        return GpuReduction(self._context)
