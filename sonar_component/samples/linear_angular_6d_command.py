"""A velocity command for a vehicle, after Rock's base::commands::LinearAngular6DCommand."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


def _unset() -> NDArray[np.float64]:
    return np.full(3, np.nan)


@dataclass
class LinearAngular6DCommand:
    """Velocities in the vehicle's own frame; NaN, as in Rock, is an axis that is not commanded.

    Attributes
    ----------
    time : int
        When the command was given [us].
    linear : (3,) float64
        Along X forward, Y left, Z up [m/s].
    angular : (3,) float64
        About them [rad/s].
    """

    time: int = 0
    linear: NDArray[np.float64] = field(default_factory=_unset)
    angular: NDArray[np.float64] = field(default_factory=_unset)

    def validate(self) -> None:
        """Raise ValueError unless both are 3 numbers that are not infinite."""
        for name in ("linear", "angular"):
            value = np.asarray(getattr(self, name))
            if value.shape != (3,) or np.isinf(value).any():
                raise ValueError(f"{name} must be 3 numbers, NaN where not commanded, got {value.tolist()}")
