"""A trajectory through given poses: straight from one to the next, or along a smooth curve.

The curve is a cubic one per interval whose velocity at each pose is that of the poses beside it (Catmull-Rom), so a
pose moves nothing beyond its second neighbours. Orientations follow the same construction on rotations (M.-J. Kim,
M.-S. Kim, S. Y. Shin, "A general construction scheme for unit quaternion curves with simple high order derivatives",
SIGGRAPH 1995): a product of exponentials with the cumulative Bernstein basis. Both keep velocities continuous.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sonar_component.samples import RigidBodyState
from sonar_component.samples.motion import exponential, interpolate, inverse, logarithm, product

Array = NDArray[np.float64]

_MOMENT = 1e-3  # [s], over which velocities are taken


@dataclass(frozen=True)
class Waypoints:
    """Poses at times, and what is between them.

    Attributes
    ----------
    times : (n,) float64
        Seconds from the first pose on, growing.
    positions : (n, 3) float64
        [m]
    orientations : (n, 4) float64
        Unit quaternions (w, x, y, z).
    interpolation : "linear" or "spline"
    at_end : "hold" or "repeat"
        What comes after the last pose.
    """

    times: Array
    positions: Array
    orientations: Array
    interpolation: Literal["linear", "spline"] = "spline"
    at_end: Literal["hold", "repeat"] = "hold"

    @property
    def duration(self) -> float:
        """Time from the first to the last pose [s]."""
        return float(self.times[-1])

    def at(self, seconds: float) -> RigidBodyState:
        """Pose and velocity."""
        if self.at_end == "repeat" and self.duration > 0:
            seconds %= self.duration
        state = self._pose(seconds)
        # Velocities over a moment around now, cut at the ends, where the vehicle begins or stops at once.
        first, last = max(seconds - _MOMENT / 2, 0.0), min(seconds + _MOMENT / 2, self.duration)
        state.velocity, state.angular_velocity = np.zeros(3), np.zeros(3)
        if first < last:
            before, after = self._pose(first), self._pose(last)
            after.time = round((last - first) * 1e6)
            moving = interpolate(before, after, 0)
            state.velocity, state.angular_velocity = moving.velocity, moving.angular_velocity
        return state

    def _pose(self, seconds: float) -> RigidBodyState:
        seconds = float(np.clip(seconds, 0.0, self.duration))
        k = int(np.clip(np.searchsorted(self.times, seconds, side="right") - 1, 0, max(len(self.times) - 2, 0)))
        if len(self.times) == 1:
            return RigidBodyState(position=self.positions[0], orientation=self.orientations[0])
        share = (seconds - self.times[k]) / (self.times[k + 1] - self.times[k])
        if self.interpolation == "linear":
            turn = logarithm(product(inverse(self.orientations[k]), self.orientations[k + 1]))
            orientation = product(self.orientations[k], exponential(share * turn))
            position = self.positions[k] + share * (self.positions[k + 1] - self.positions[k])
        else:
            position, orientation = self._curve(k, share)
        return RigidBodyState(position=position, orientation=orientation / np.linalg.norm(orientation))

    def _curve(self, k: int, s: float) -> tuple[Array, Array]:
        span = self.times[k + 1] - self.times[k]
        velocities, rates = self._tangents
        p, v = self.positions[k : k + 2], velocities[k : k + 2] * span
        position = (
            (2 * s**3 - 3 * s**2 + 1) * p[0] + (s**3 - 2 * s**2 + s) * v[0]
            + (3 * s**2 - 2 * s**3) * p[1] + (s**3 - s**2) * v[1]
        )  # fmt: skip
        first, last = rates[k] * span / 3, rates[k + 1] * span / 3
        whole = product(inverse(self.orientations[k]), self.orientations[k + 1])
        middle = logarithm(product(product(exponential(-first), whole), exponential(-last)))
        orientation = self.orientations[k]
        for turn, share in ((first, 1 - (1 - s) ** 3), (middle, 3 * s**2 - 2 * s**3), (last, s**3)):
            orientation = product(orientation, exponential(share * turn))
        return position, orientation

    @cached_property
    def _tangents(self) -> tuple[Array, Array]:
        """Velocities [m/s] and rates of turn [rad/s] at the poses: those of the parabola through the neighbours."""
        spans = np.diff(self.times)
        turns = [
            logarithm(product(inverse(a), b))
            for a, b in zip(self.orientations[:-1], self.orientations[1:], strict=True)
        ]
        return (
            _at_poses(np.diff(self.positions, axis=0) / spans[:, None], spans),
            _at_poses(np.array(turns) / spans[:, None], spans),
        )


def _at_poses(between: Array, spans: Array) -> Array:
    """(n, 3) velocities at the poses from (n - 1, 3) velocities between them; at the ends, that of the interval."""
    inner = (between[:-1] * spans[1:, None] + between[1:] * spans[:-1, None]) / (spans[:-1] + spans[1:])[:, None]
    return np.concatenate([between[:1], inner, between[-1:]])


def placed(waypoints: Sequence[Array], X_WT: Array, q_WT: Array) -> tuple[Array, Array]:
    """Positions (n, 3) and orientations (n, 4) of a trajectory's own frame T, in the world."""
    positions, orientations = waypoints
    return positions @ X_WT[:3, :3].T + X_WT[:3, 3], np.array([product(q_WT, q) for q in orientations])
