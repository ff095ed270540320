"""Motion within a ping: the far bins of a long ping see the later pose.

An echo from range r was sent at t and is heard at t + 2 r / c. To first order in what happens in between, its range and
bearing are those of the pose at t + r / c: the path there and back is half of each, and so is the beam pattern of
sending and hearing. The ping is therefore rendered from a few poses, and each gives the bins that belong to its time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from sonar_component.samples import RigidBodyState
from sonar_component.samples.motion import carried_on

Echoes = Callable[[RigidBodyState], NDArray[np.float32]]

MOST_POSES = 16  # [-], bounds the cost where a vehicle turns very fast


def moving_echoes(
    echoes: Echoes, pose: RigidBodyState, last_range: float, bin_length: float, speed_of_sound: float, beam: float
) -> NDArray[np.float32]:
    """Echoes of a sonar that moves while it listens, with the velocities that its pose holds.

    Parameters
    ----------
    echoes : function
        Renders (beams, bins) from one pose.
    pose : RigidBodyState
        At the time of sending; velocities that are NaN count as 0.
    last_range, bin_length : float
        [m]
    speed_of_sound : float
        [m/s]
    beam : float
        Width of a beam [rad].

    Returns
    -------
    (beams, bins) float32
    """
    count = poses_needed(pose, last_range / speed_of_sound, bin_length, beam)
    if count == 1:
        middle = last_range / speed_of_sound / 2
        return echoes(carried_on(pose, pose.time + round(middle * 1e6)))
    bin_count = round(last_range / bin_length)
    edges = np.rint(np.linspace(0, bin_count, count + 1)).astype(int)
    whole: NDArray[np.float32] | None = None
    for first, end in pairwise(edges):
        delay = (first + end) / 2 * bin_length / speed_of_sound
        part = echoes(carried_on(pose, pose.time + round(delay * 1e6)))
        whole = np.empty_like(part) if whole is None else whole
        whole[:, first:end] = part[:, first:end]
    assert whole is not None
    return whole


def poses_needed(pose: RigidBodyState, duration: float, bin_length: float, beam: float) -> int:
    """How many poses keep each bin within half a bin and an eighth of a beam of its own pose."""
    velocity, rate = (np.nan_to_num(v, nan=0.0) for v in (pose.velocity, pose.angular_velocity))
    bins = float(np.linalg.norm(velocity)) * duration / bin_length
    beams = float(np.linalg.norm(rate)) * duration / beam
    return int(np.clip(math.ceil(max(bins, 4 * beams)), 1, MOST_POSES))
