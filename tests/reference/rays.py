"""First hits of rays, triangle by triangle in float64, and the directions of a layout's cells."""

from __future__ import annotations

from typing import Any

import numpy as np


def directions(layout: Any, right: float = 0.0, up: float = 0.0) -> np.ndarray:
    """(columns, rows, 3) unit vectors in the sonar's frame through the cells' centres, or so many cells beside them."""
    parts = []
    for view in layout.views:
        ahead = np.array([np.cos(view.azimuth), np.sin(view.azimuth), 0.0])
        rightward = np.array([np.sin(view.azimuth), -np.cos(view.azimuth), 0.0])
        x = (view.column_centres() + right * view.x_step)[:, None]
        # Cells beside a column's are measured from that column, not from its neighbour's sheared ones.
        y = view.column_bottoms()[:, None] + (np.arange(layout.rows) + 0.5 + up) * view.y_step
        ray = ahead + x[..., None] * rightward + y[..., None] * np.array([0.0, 0.0, 1.0])
        parts.append(ray / np.linalg.norm(ray, axis=-1, keepdims=True))
    return np.concatenate(parts)


def first_hits(triangles: np.ndarray, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ranges, infinite on a miss, and numbers of the triangles hit by rays (..., 3) from the origin."""
    ranges, which = np.full(rays.shape[:-1], np.inf), np.full(rays.shape[:-1], -1)
    for number, (a, b, c) in enumerate(triangles.astype(np.float64)):
        normal = np.cross(b - a, c - a)
        along = rays @ normal
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (a @ normal) / along
        points = rays * np.where(np.isfinite(distance), distance, 0.0)[..., None]
        inside = np.isfinite(distance) & (distance > 0) & (distance < ranges)
        for p, q in ((a, b), (b, c), (c, a)):
            inside &= np.cross(q - p, points - p) @ normal >= 0
        ranges, which = np.where(inside, distance, ranges), np.where(inside, number, which)
    return ranges, which
