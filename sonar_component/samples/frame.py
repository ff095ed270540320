"""An image sample, after Rock's base::samples::frame::Frame."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass
class Frame:
    """A picture with the time when what it shows was true.

    Attributes
    ----------
    time : int
        Data time [us]; 0 means not set.
    image : (rows, columns, channels) array
        Row 0 is the top. uint8 for pictures, float32 for measured channels.
    channels : str
        Names of the channels joined by commas, such as ``"strength,range,bearing"``.
    """

    time: int = 0
    image: NDArray[np.generic] = field(default_factory=lambda: np.zeros((0, 0, 0), np.uint8))
    channels: str = ""

    def validate(self) -> None:
        """Raise ValueError naming what does not fit together."""
        if self.image.ndim != 3:
            raise ValueError(f"image must have 3 dimensions (rows, columns, channels), got {self.image.ndim}")
        if self.channels and len(self.channels.split(",")) != self.image.shape[2]:
            raise ValueError(f"channels names {self.channels!r}, but the image has {self.image.shape[2]}")
