"""Timing of whole frames: pose in, message ready to send."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from sonar_component.middleware.codec import encode
from sonar_component.samples import Sonar

_WARM_UP = 5  # [frames], not counted: planning, compiling, first touch of memory
_ENVELOPE: dict[str, Any] = {"e": 1, "src": "bench.sonar_samples", "run": "", "seq": 1, "t": 1, "tp": 1, "clk": "wall"}


@dataclass(frozen=True)
class Times:
    """Of one frame [ms].

    Attributes
    ----------
    mean, deviation, median, p99 : float
    fps : float
        From the mean [1/s].
    first : float
        The very first frame, planning and compiling included.
    """

    mean: float
    deviation: float
    median: float
    p99: float
    fps: float
    first: float

    def data(self) -> dict[str, float]:
        """For JSON: the same with the unit in the names."""
        return {key if key == "fps" else f"{key}_ms": round(value, 4) for key, value in asdict(self).items()}


def time_frames(ping: Callable[[], Sonar], count: int, tick: Callable[[], None] = lambda: None) -> Times:
    """Time `count` frames of a sonar, each up to its packed message."""
    durations = [_frame(ping) for _ in range(_WARM_UP)]
    first, durations = durations[0], []
    for _ in range(count):
        durations.append(_frame(ping))
        tick()
    ms = 1e3 * np.array(durations)
    mean = float(ms.mean())
    return Times(mean, float(ms.std()), float(np.median(ms)), float(np.percentile(ms, 99)), 1e3 / mean, 1e3 * first)


def _frame(ping: Callable[[], Sonar]) -> float:
    began = time.perf_counter()
    encode(ping(), _ENVELOPE)
    return time.perf_counter() - began
