"""A sonar image as a figure: colour bar, axes in metres, range rings, bearing ticks, time and settings in the title.

Decision: matplotlib's Agg canvas, used through Figure objects and never through pyplot. pyplot keeps figures in a
global list and chooses a window toolkit at import; both are wrong in a long-running task without a display. Drawing
text and colour bars on pixels ourselves was the alternative, and is a small plotter nobody wants to maintain.
Matplotlib is imported inside the functions: it takes 0.4 s, and most commands draw nothing.
"""

from __future__ import annotations

from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Literal

import numpy as np

from sonar_component.pictures.colours import NO_DATA, Tone, colour_table, fit_tone, paint
from sonar_component.pictures.fan import Interpolation, beam_edges, fan_map
from sonar_component.samples import Sonar

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Kind = Literal["fan", "polar"]

_RING_STEPS = (1, 2, 5)  # [-], times a power of ten: range rings at round metres
_RINGS = 5  # [-], about as many rings
_TICK_STEPS = (1, 2, 5, 10, 15, 30, 45)  # [deg]
_TICKS = 9  # [-], at most as many bearing ticks
_WALL_CLOCK = 10**15  # [us], September 2001: a smaller time counts from the start of a simulation
_WIDTH = 9.0  # [inch], 900 pixels at 100 dpi
_GRID = {"color": "white", "alpha": 0.35, "linewidth": 0.7}


def save_png(
    sonar: Sonar,
    path: str | Path | BinaryIO,
    kind: Kind = "fan",
    colour_map: str = "copper",
    tone: Tone | None = None,
    interpolation: Interpolation = "nearest",
    name: str = "",
) -> None:
    """Write a sonar image as a PNG file.

    Parameters
    ----------
    sonar : Sonar
    path : str, Path or open binary file
    kind : "fan" or "polar"
        The world seen from above, or bearing against range.
    colour_map : "copper", "gray" or "viridis"
    tone : Tone
        Which echo strengths are shown; by default 40 dB below the strongest echoes.
    interpolation : "nearest" or "linear"
    name : str
        What the title calls the image, such as ``fls.sonar_samples``.

    Raises
    ------
    ValueError
        If the sample's fields do not fit together, or an option is not known.
    OSError
        If the file cannot be written.
    """
    picture = figure(sonar, kind, colour_map, tone, interpolation, name)
    labels = {"Title": name or "sonar", "Description": settings_line(sonar)}
    picture.savefig(path, format="png", dpi=100, metadata=labels)


def figure(
    sonar: Sonar,
    kind: Kind = "fan",
    colour_map: str = "copper",
    tone: Tone | None = None,
    interpolation: Interpolation = "nearest",
    name: str = "",
) -> Figure:
    """The figure that ``save_png`` writes; see there."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    if kind not in ("fan", "polar"):
        raise ValueError(f"kind must be fan or polar, got {kind!r}")
    sonar.validate()
    tone = tone or fit_tone(sonar.bins)
    picture = Figure(figsize=_figure_size(sonar, kind), layout="constrained")
    FigureCanvasAgg(picture)
    axes = picture.add_subplot()
    if kind == "fan":
        _draw_fan(axes, sonar, tone, colour_map, interpolation)
    else:
        _draw_polar(axes, sonar, tone, colour_map)
    _draw_colour_bar(picture, axes, tone, colour_map, has_gaps=bool(np.isnan(sonar.bins).any()))
    axes.set_title(f"{name}  {time_text(sonar.time)}\n{settings_line(sonar)}".strip())
    return picture


def _figure_size(sonar: Sonar, kind: Kind) -> tuple[float, float]:
    """Width and height [inch]: the height follows the fan's shape, so that a flat fan is not lost in white paper."""
    if kind == "polar":
        return _WIDTH, 7.5
    left, right, bottom, top = fan_map(sonar).extent
    return _WIDTH, float(np.clip(1.6 + 6.8 * (top - bottom) / (left - right), 4.0, 9.0))


def time_text(time: int) -> str:
    """A sample's time for people: UTC for wall-clock time, seconds for simulated time, nothing if not set."""
    if time == 0:
        return ""
    if time < _WALL_CLOCK:
        return f"t = {time / 1e6:.3f} s"
    return datetime.fromtimestamp(time / 1e6, timezone.utc).strftime("%Y-%m-%d %H:%M:%S.%f")[:-3] + " UTC"


def settings_line(sonar: Sonar) -> str:
    """The sonar's settings in one line: beams, bins, opening, range, speed of sound."""
    reach = sonar.bin_count * sonar.bin_length
    opening = " x ".join(f"{np.degrees(a):.4g} deg" for a in (sonar.beam_width, sonar.beam_height) if np.isfinite(a))
    counts, water = f"{sonar.beam_count} x {sonar.bin_count}", f"c {sonar.speed_of_sound:.5g} m/s"
    return ", ".join(part for part in (counts, opening, f"0 to {reach:.4g} m", water) if part)


def ring_ranges(reach: float) -> list[float]:
    """Round ranges [m] for about five rings, the last one inside ``reach`` [m]."""
    rough = reach / _RINGS
    power = 10.0 ** np.floor(np.log10(rough))
    step = min((s * p for p in (power, power * 10) for s in _RING_STEPS), key=lambda candidate: abs(candidate - rough))
    return [float(step * i) for i in range(1, int(reach / step + 1e-9) + 1)]


def tick_bearings(first: float, last: float) -> list[float]:
    """Round bearings [deg] between two edges [deg]: at most nine, twelve all round."""
    most = _TICKS if last - first < 350 else 12
    steps = [s for s in _TICK_STEPS if (last - first) / s <= most] or [90]
    ticks = np.arange(np.ceil(first / steps[0] - 1e-9), last / steps[0] + 1e-9) * steps[0]
    if last - first > 359:  # the first and the last tick of a full turn are the same direction
        ticks = ticks[ticks < first + 360 - 1e-6]
    return [float(t) for t in ticks]


def _draw_fan(axes: Any, sonar: Sonar, tone: Tone, colour_map: str, interpolation: Interpolation) -> None:
    table = fan_map(sonar)
    colours = paint(table.apply(sonar.bins, interpolation), tone, colour_map)
    opaque = np.where(table.inside, 255, 0).astype(np.uint8)
    left, right, bottom, top = table.extent
    axes.imshow(np.dstack([colours, opaque]), extent=table.extent, origin="upper", interpolation="nearest")
    edges = beam_edges(np.sort(sonar.bearings), sonar.beam_width)
    reach = sonar.bin_count * sonar.bin_length
    sector = np.linspace(edges[0], edges[-1], 181)
    for ring in [*ring_ranges(reach), reach]:
        axes.plot(ring * np.sin(sector), ring * np.cos(sector), **_GRID)
    for tick in tick_bearings(*np.degrees([edges[0], edges[-1]])):
        y, x = np.sin(np.radians(tick)), np.cos(np.radians(tick))
        axes.plot([0, reach * y], [0, reach * x], **{**_GRID, "alpha": 0.15})
        label = f"{wrap(tick):+.0f}°" if tick % 180 else f"{abs(wrap(tick)):.0f}°"
        axes.text(1.03 * reach * y, 1.03 * reach * x, label, ha="center", va="center", fontsize=8)
    margin = (0.07 if left < 0.99 * reach else 0.12) * reach  # the labels of +90 and -90 deg stand outside the picture
    axes.set_xlim(left + margin, right - margin)
    axes.set_ylim(bottom - margin / 2, top + margin)
    axes.set_aspect("equal")
    axes.set_facecolor("#e8e8ec")
    axes.set_xlabel("y, to the left [m]")
    axes.set_ylabel("x, ahead [m]")


def wrap(degrees: float) -> float:
    """A bearing in degrees between -180 (not included) and 180."""
    return -((180.0 - degrees) % 360.0 - 180.0)


def _draw_polar(axes: Any, sonar: Sonar, tone: Tone, colour_map: str) -> None:
    from matplotlib.colors import ListedColormap

    order = np.argsort(sonar.bearings, kind="stable")
    edges = np.degrees(beam_edges(sonar.bearings[order], sonar.beam_width))
    ranges = np.arange(sonar.bin_count + 1) * sonar.bin_length
    colours = ListedColormap(colour_table(colour_map) / 255.0).with_extremes(bad=np.array(NO_DATA) / 255.0)
    levels = np.ma.masked_invalid(tone.levels(sonar.bins[order]).T)
    axes.pcolormesh(edges, ranges, levels, cmap=colours, vmin=0, vmax=1, rasterized=True)
    axes.set_xlim(edges[-1], edges[0])
    axes.set_xticks(tick_bearings(edges[0], edges[-1]))
    axes.grid(**{**_GRID, "alpha": 0.2})
    axes.set_xlabel("bearing, to the left [deg]")
    axes.set_ylabel("range [m]")


def _draw_colour_bar(picture: Any, axes: Any, tone: Tone, colour_map: str, has_gaps: bool) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize
    from matplotlib.patches import Patch

    bottom, top = (-tone.dynamic_range, 0.0) if tone.dynamic_range > 0 else (0.0, tone.ceiling)
    scale = ScalarMappable(Normalize(bottom, top), ListedColormap(colour_table(colour_map) / 255.0))
    picture.colorbar(scale, ax=axes, label=tone.label(), shrink=0.8, extend="both" if tone.dynamic_range > 0 else "max")
    if has_gaps:
        patch = Patch(facecolor=np.array(NO_DATA) / 255.0, label="no data")
        axes.legend(handles=[patch], loc="lower left", fontsize=8)
