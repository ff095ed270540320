"""What time it is in the world: the wall, a simulated clock that runs at a rate, or lock-step.

All processes of a host share CLOCK_MONOTONIC, so a simulated clock needs no messages there:
time = epoch + rate * (now - start).
In lock-step the conductor sets the time and nothing moves in between.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Protocol


class Clock(Protocol):
    """Data time and pace."""

    name: str
    rate: float

    def now(self) -> int:
        """Data time [us]."""


@dataclass
class WallClock:
    """Real time, counted from 1970."""

    name: str = "wall"
    rate: float = 1.0

    def now(self) -> int:
        """Data time [us]."""
        return time.time_ns() // 1000


@dataclass
class SimulatedClock:
    """Time that runs `rate` times as fast as the wall.

    Attributes
    ----------
    epoch : data time [us] at `start`.
    start : CLOCK_MONOTONIC of this host [s].
    """

    epoch: int
    start: float
    rate: float = 1.0
    name: str = "sim"

    def now(self) -> int:
        """Data time [us]."""
        return self.epoch + round((time.monotonic() - self.start) * self.rate * 1e6)


@dataclass
class SteppedClock:
    """Time that stands still until it is set."""

    time: int = 0
    rate: float = 1.0
    name: str = "sim"

    def now(self) -> int:
        """Data time [us]."""
        return self.time
