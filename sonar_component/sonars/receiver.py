"""From clean echoes to what the sample holds: spreading, speckle, time-varying gain, gain."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sonar_component.acoustics.spreading import amplitude, spreading_loss, time_varying_gain
from sonar_component.noise import Speckle
from sonar_component.samples.motion import moved_between
from sonar_component.sonars.settings import SonarSettings

Image = NDArray[np.float32]


class Receiver:
    """Works in place on the echoes of one sonar; remembers its speckle and from where it last heard."""

    def __init__(self, settings: SonarSettings) -> None:
        self._speckle: Speckle | None = None
        self._last: NDArray[np.float64] | None = None
        self.adopt(settings)

    def adopt(self, settings: SonarSettings) -> None:
        """Take settings into force; speckle goes on unless its own settings changed."""
        self._settings = settings
        ranges = (np.arange(settings.bin_count, dtype=np.float64) + 0.5) * (settings.range / settings.bin_count)
        tvg = settings.time_varying_gain
        raised = time_varying_gain(ranges, tvg.spreading, tvg.absorption, tvg.limit)
        self._loss = _factors(-spreading_loss(ranges, settings.spreading))
        self._raise = _factors(raised)
        if self._speckle is None or self._speckle.properties != settings.speckle_properties:
            self._speckle = Speckle(settings.speckle_properties)

    def fan(self, bins: Image, X_WS: NDArray[np.float64], rng: np.random.Generator | None) -> Image:
        """All beams of a ping, (beams, bins), heard from X_WS (4, 4); `rng` feeds the speckle, if that is on."""
        self._lose(bins)
        if rng is not None and self._settings.enable_speckle_noise:
            assert self._speckle is not None
            self._speckle.apply(bins, rng, self._stirred(X_WS))
        return self._amplify(bins)

    def beam(
        self, bins: Image, X_WS: NDArray[np.float64], place: int, places: int, rng: np.random.Generator | None
    ) -> Image:
        """The beam of a scanning head at `place` of `places`, (1, bins); X_WS is the pose of its base."""
        self._lose(bins)
        if rng is not None and self._settings.enable_speckle_noise:
            assert self._speckle is not None
            self._speckle.apply_beam(bins, place, places, rng, self._stirred(X_WS))
        return self._amplify(bins)

    def _lose(self, bins: Image) -> None:
        if self._loss is not None:
            bins *= self._loss

    def _amplify(self, bins: Image) -> Image:
        if self._raise is not None:
            bins *= self._raise
        return with_gain(bins, self._settings.gain)

    def _stirred(self, X_WS: NDArray[np.float64]) -> float:
        last, self._last = self._last, X_WS
        assert self._speckle is not None
        return 0.0 if last is None else self._speckle.stirring(*moved_between(last, X_WS))


def with_gain(bins: Image, gain: float) -> Image:
    """Rock's gain: 0.5 is unity, and what exceeds full scale is clipped to 1. Works in place."""
    if gain != 0.5:
        bins *= np.float32(2 * gain)
    return np.minimum(bins, np.float32(1.0), out=bins)


def _factors(decibels: NDArray[np.float64]) -> Image | None:
    """Factors (bins,), or None where nothing is to be done: clean must stay bit-exact."""
    return amplitude(decibels).astype(np.float32) if decibels.any() else None
