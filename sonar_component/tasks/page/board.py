"""What the page shows now: the latest image of each sonar, the sweep of each scanning head, and how each stream is.

The task's thread writes, the page's thread reads. Nothing queues here: a new image replaces the old one, so a page that
is slow or gone costs the sonar nothing and memory does not grow.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sonar_component.pictures.colours import fit_tone
from sonar_component.pictures.sweep import SLOTS, Sweep
from sonar_component.samples import Frame, Sonar

_RATE_WINDOW = 5.0  # [s], over which the frame rate is taken
_RATE_SAMPLES = 1000  # [-], bounds the memory of the rate at 200 beams a second over the window
_NOTICE_STAYS = 10.0  # [s]
_CEILING_PERIOD = 0.5  # [s], between two looks at the brightest echoes: a percentile of 128 000 values takes 2 ms
_CEILING_STEP = 0.3  # [-], share of the way that the automatic brightness goes at once, so that it does not flicker


@dataclass
class Channel:
    """One sonar as the page sees it.

    Attributes
    ----------
    source : ``task.port`` of the writer.
    version : grows with every change of what is to be drawn.
    latest : the last image as it came.
    sweep : the turn of a scanning head, None for a sonar that images many beams at once.
    row_version : (beams,) version in which each row of the picture last changed.
    ceiling : echo strength that the automatic brightness shows brightest.
    notice : what is odd about the stream, in words, with the time it was said [s, monotonic].
    dropped, lost, invalid : samples that did not fit the buffer, that never arrived, and that could not be drawn.
    """

    source: str
    version: int = 0
    latest: Sonar | None = None
    sweep: Sweep | None = None
    row_version: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    ceiling: float = 0.0
    notice: str = ""
    noticed: float = 0.0
    dropped: int = 0
    lost: int = 0
    invalid: int = 0
    arrivals: deque[float] = field(default_factory=lambda: deque(maxlen=_RATE_SAMPLES))
    _looked: float = 0.0

    def rate(self, now: float) -> float:
        """Images a second over the last seconds [Hz]; 0 when the stream has stopped."""
        recent = [t for t in self.arrivals if now - t < _RATE_WINDOW]
        if len(recent) < 2:
            return 0.0
        span, silence = recent[-1] - recent[0], now - recent[-1]
        if silence > 2 * span / (len(recent) - 1):  # a stream that has stopped must not go on showing its old rate
            span += silence
        return (len(recent) - 1) / span if span > 0 else 0.0

    def picture(self) -> Sonar:
        """The image to draw: the last one, or the turn so far.

        Raises
        ------
        ValueError
            If nothing came yet.
        """
        if self.sweep is not None:
            return self.sweep.as_sonar()
        if self.latest is None:
            raise ValueError(f"{self.source}: no image yet")
        return self.latest

    def take(self, sonar: Sonar, now: float) -> None:
        """Show a new image."""
        self.version += 1
        self.arrivals.append(now)
        before, self.latest = self.latest, sonar
        if before is not None and before.bins.shape != sonar.bins.shape:
            self.say(f"shape changed from {_shape(before)} to {_shape(sonar)} beams x bins", now)
        if sonar.beam_count == 1:  # one beam at a time is a scanning head; base-types has no other mark
            self._turn(sonar)
        else:
            self.sweep, self.row_version = None, np.full(sonar.beam_count, self.version)
        if now - self._looked > _CEILING_PERIOD:
            self._looked = now
            self._follow(fit_tone(self.sweep.bins if self.sweep else sonar.bins).ceiling)

    def facts(self, now: float) -> dict[str, Any]:
        """Rate [Hz], seconds since the last image, what was not shown, and what is odd, for the page."""
        return {
            "rate": round(self.rate(now), 2),
            "since": round(now - self.arrivals[-1], 2) if self.arrivals else None,
            "dropped": self.dropped,
            "lost": self.lost,
            "invalid": self.invalid,
            "notice": self.notice if now - self.noticed < _NOTICE_STAYS else "",
        }

    def say(self, text: str, now: float) -> None:
        """Note something odd for the page."""
        self.notice, self.noticed = text, now

    def _turn(self, sonar: Sonar) -> None:
        if self.sweep is None:
            self.sweep, self.row_version = Sweep(), np.full(SLOTS, self.version)
        restarts = self.sweep.restarts
        changed = self.sweep.add(sonar)
        if self.sweep.restarts != restarts:
            self.row_version[:] = self.version
        self.row_version[changed] = self.version

    def _follow(self, ceiling: float) -> None:
        if self.ceiling <= 0:
            self.ceiling = ceiling
        self.ceiling *= (ceiling / self.ceiling) ** _CEILING_STEP


def _shape(sonar: Sonar) -> str:
    return f"{sonar.beam_count} x {sonar.bin_count}"


class Board:
    """All channels, the camera's last frame, and whom to tell when something changed."""

    def __init__(self) -> None:
        self.channels: dict[str, Channel] = {}
        self.camera: Frame | None = None
        self.camera_version = 0
        self.lock = threading.Lock()
        self.on_change: Callable[[], None] = lambda: None

    def put(self, source: str, sonar: Sonar) -> str:
        """Show a sonar's new image; one that cannot be drawn is counted and said.

        Returns
        -------
        str
            What is newly odd about the stream, to be logged; mostly nothing.
        """
        now = time.monotonic()
        with self.lock:
            channel = self.channels.setdefault(source, Channel(source))
            before = channel.notice
            try:
                channel.take(sonar, now)
            except ValueError as error:
                channel.invalid += 1
                channel.say(str(error), now)
        self.on_change()
        return channel.notice if channel.notice != before else ""

    def refuse(self, source: str, reason: str) -> bool:
        """Count an image that cannot be drawn; True if the reason is a new one, to be logged."""
        with self.lock:
            channel = self.channels.setdefault(source, Channel(source))
            channel.invalid += 1
            fresh = channel.notice != reason
            channel.say(reason, time.monotonic())
        return fresh

    def put_camera(self, frame: Frame) -> None:
        """Show a new camera frame."""
        with self.lock:
            self.camera, self.camera_version = frame, self.camera_version + 1
        self.on_change()
