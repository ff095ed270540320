"""A fan in a terminal: half blocks in colour, or plain characters where colours would end up in a file.

Each cell shows the strongest echo in it: at 80 columns a cell holds dozens of bins, and the one at its centre would
miss most targets.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sonar_component.pictures.colours import Tone, fit_tone, paint
from sonar_component.pictures.fan import fan_map
from sonar_component.samples import Sonar

_RAMP = " .:-=+*#%@"  # darkest to brightest
_NO_DATA = "?"
_FINER = 6  # [-] pixels of the fan per pixel of the terminal, in each direction


def text_picture(sonar: Sonar, columns: int = 80, colour: bool = False, tone: Tone | None = None) -> str:
    """Draw a fan with characters.

    Parameters
    ----------
    sonar : Sonar
    columns : int
        Width of the picture in characters; a character is taken to be twice as high as wide.
    colour : bool
        24-bit colours by escape sequences, two rows of pixels in a line of text.
    tone : Tone
        Which echo strengths are shown; by default 40 dB below the strongest.
    """
    values, inside = _cells(sonar, columns)
    tone = tone or fit_tone(sonar.bins)
    return _in_colour(values, inside, tone) if colour else _plain(values, inside, tone)


def _cells(sonar: Sonar, columns: int) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Strongest echo and membership of the fan in each cell: an even number of rows, ``columns`` wide."""
    left, right, bottom, top = fan_map(sonar, 16).extent
    longer = max(left - right, top - bottom) / (left - right)
    table = fan_map(sonar, round(columns * _FINER * longer))
    picture = table.apply(sonar.bins)
    rows = -(-picture.shape[0] // (2 * _FINER)) * 2 * _FINER
    wide = columns * _FINER
    values = np.full((rows, wide), np.nan, np.float32)
    inside = np.zeros((rows, wide), bool)
    height, width = picture.shape[0], min(wide, picture.shape[1])
    values[:height, :width], inside[:height, :width] = picture[:, :width], table.inside[:, :width]
    blocks = values.reshape(rows // _FINER, _FINER, columns, _FINER)
    strongest = np.fmax.reduce(np.fmax.reduce(blocks, axis=3), axis=1)
    _raise_to(strongest, sonar, table.extent, picture.shape)
    belongs = inside.reshape(blocks.shape).mean(axis=(1, 3)) >= 0.5
    return strongest, belongs


def _raise_to(
    cells: NDArray[np.float32],
    sonar: Sonar,
    extent: tuple[float, float, float, float],
    pixels: tuple[int, ...],
) -> None:
    """Raise each cell to the strongest bin whose middle lies in it: between pixels there may be many bins."""
    left, right, bottom, top = extent
    r, b = sonar.bin_ranges()[None, :], sonar.bearings[:, None]
    row = (top - r * np.cos(b)) / (top - bottom) * pixels[0] / _FINER
    column = (left - r * np.sin(b)) / (left - right) * pixels[1] / _FINER
    last_row, last_column = cells.shape[0] - 1, cells.shape[1] - 1
    at = (np.clip(row.astype(int), 0, last_row), np.clip(column.astype(int), 0, last_column))
    np.fmax.at(cells, at, sonar.bins)


def _plain(values: NDArray[np.float32], inside: NDArray[np.bool_], tone: Tone) -> str:
    values, inside = np.fmax(values[0::2], values[1::2]), inside[0::2] | inside[1::2]
    levels = tone.levels(values)
    places = np.where(np.isnan(levels), 0, levels * (len(_RAMP) - 1) + 0.5).astype(int)
    letters = np.where(np.isnan(levels), _NO_DATA, np.array(list(_RAMP))[places])
    return "\n".join("".join(row).rstrip() for row in np.where(inside, letters, " "))


def _in_colour(values: NDArray[np.float32], inside: NDArray[np.bool_], tone: Tone) -> str:
    colours = paint(values, tone)
    lines = []
    for row in range(0, len(values), 2):
        cells = [_cell(colours[row : row + 2, c], inside[row : row + 2, c]) for c in range(values.shape[1])]
        lines.append("".join(cells).rstrip() + "\x1b[0m")
    return "\n".join(lines)


def _cell(colours: NDArray[np.uint8], inside: NDArray[np.bool_]) -> str:
    """One character of two pixels: the block is the foreground, the rest the background."""
    (upper, lower), (above, below) = colours.tolist(), inside.tolist()
    if not above and not below:
        return "\x1b[0m "
    if above and below:
        return f"\x1b[38;2;{upper[0]};{upper[1]};{upper[2]};48;2;{lower[0]};{lower[1]};{lower[2]}m▀"
    one, block = (upper, "▀") if above else (lower, "▄")
    return f"\x1b[0;38;2;{one[0]};{one[1]};{one[2]}m{block}"
