"""Echo strength -> colour: a tone (which values are shown) and a colour map (how).

Decision: the default tone is logarithmic, 40 dB below a ceiling that 99.9 % of the lit bins stay under. Echo strengths
span decades: on a linear scale that shows the strongest echo, a floor at grazing incidence (the paper's sigmoid gives
0.008 there) is two of 255 grey steps and looks like a shadow. A true zero (a shadow of a noise-free image) is drawn in
the darkest colour, NaN in a colour of its own: nothing measured is not the same as nothing heard.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

COLOUR_MAPS = ("copper", "gray", "viridis")
NO_DATA = (110, 0, 70)  # sRGB, a dull magenta: far from every colour of the three maps, and not black

_PERCENTILE = 99.9  # [%], a handful of glints must not darken the whole picture
_DYNAMIC_RANGE = 40.0  # [dB], see above: holds a floor at S(0.2) = 2e-4 beside a target at 1


@dataclass(frozen=True)
class Tone:
    """Which echo strengths are shown, from darkest to brightest.

    Attributes
    ----------
    ceiling : float
        Echo strength drawn in the brightest colour.
    dynamic_range : float
        Extent of the scale below the ceiling [dB], 10 log10 of echo strength; 0 for a linear scale from 0.
    """

    ceiling: float = 1.0
    dynamic_range: float = _DYNAMIC_RANGE

    def levels(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Place values on the scale: 0 darkest, 1 brightest, NaN where a value is NaN. Same shape, float32."""
        share = np.asarray(values, np.float32) / np.float32(self.ceiling)
        if self.dynamic_range > 0:
            with np.errstate(divide="ignore", invalid="ignore"):  # log of 0 is -inf and ends on the darkest colour
                share = 1 + 10 * np.log10(np.maximum(share, 0)) / np.float32(self.dynamic_range)
        return np.asarray(np.clip(share, 0, 1), np.float32)

    def label(self) -> str:
        """What the colour bar says."""
        if self.dynamic_range > 0:
            return f"echo strength [dB re {self.ceiling:.3g}]"
        return f"echo strength [-], linear to {self.ceiling:.3g}"


def fit_tone(
    bins: NDArray[np.float32],
    scale: Literal["db", "linear"] = "db",
    dynamic_range: float = _DYNAMIC_RANGE,
    gain: float = 0.0,
) -> Tone:
    """A tone whose ceiling 99.9 % of the lit bins stay under.

    Parameters
    ----------
    bins : (beams, bins) float32
    scale : "db" or "linear"
    dynamic_range : float
        [dB]; not used by the linear scale.
    gain : float
        Brightens the picture by so many dB: lowers the ceiling.
    """
    lit = bins[bins > 0]  # comparisons with NaN are false
    ceiling = float(np.percentile(lit, _PERCENTILE)) if lit.size else 1.0
    return Tone(ceiling * 10 ** (-gain / 10), dynamic_range if scale == "db" else 0.0)


@cache
def colour_table(name: str) -> NDArray[np.uint8]:
    """The 256 colours of a map, darkest first.

    Returns
    -------
    (256, 3) uint8, sRGB

    Raises
    ------
    ValueError
        If the name is not one of ``COLOUR_MAPS``.
    """
    if name not in COLOUR_MAPS:
        raise ValueError(f"colour map must be one of {', '.join(COLOUR_MAPS)}, got {name!r}")
    from matplotlib import colormaps  # 0.2 s to import, and a ping without a picture needs none of it

    table = np.asarray(np.rint(colormaps[name](np.arange(256))[:, :3] * 255), np.uint8)
    table.flags.writeable = False
    return table


def paint(values: NDArray[np.float32], tone: Tone, colour_map: str = "copper") -> NDArray[np.uint8]:
    """Colour each value; NaN becomes the no-data colour.

    Returns
    -------
    (..., 3) uint8, sRGB
    """
    levels = tone.levels(values)
    missing = np.isnan(levels)
    picture = colour_table(colour_map)[np.where(missing, 0, levels * 255 + 0.5).astype(np.uint8)]
    picture[missing] = NO_DATA
    return picture
