"""The paper's Tables 1 and 2 on the comparison scene, with the error against the converged reference at each time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from sonar_component.cli.benchmarks.scenes import Case, comparison
from sonar_component.cli.benchmarks.timing import time_frames
from sonar_component.echo.beams import equal_angle
from sonar_component.gl import Context, create_context
from sonar_component.sonars.forward_looking import ForwardLookingSonar
from sonar_component.sonars.reference import Sums, converged, errors
from sonar_component.sonars.settings import ForwardLookingSettings

RANGE = 30.0  # [m]
# Cerqueira et al. 2017, Tables 1 and 2: beams, bins, fan [deg], and their mean time [ms] on their graphics card.
PAPER = (
    (128, 500, 120, 20, 54.7),
    (128, 1000, 120, 20, 72.3),
    (256, 500, 120, 20, 198.7),
    (256, 1000, 120, 20, 218.2),
    (128, 500, 90, 15, 77.4),
    (128, 1000, 90, 15, 94.6),
    (256, 500, 90, 15, 260.8),
    (256, 1000, 90, 15, 268.7),
    (1, 500, 3, 35, 8.8),
    (1, 1000, 3, 35, 34.5),
    (1, 500, 2, 20, 10.3),
    (1, 1000, 2, 20, 41.7),
)
_FINEST_BEAMS, _FINEST_BINS = 256, 1000


def run(samples: int, accuracies: tuple[float, ...], say: Callable[[str], None], tick: Callable[[], None]) -> Any:
    """Rows of both tables.

    Parameters
    ----------
    samples : int
        Frames per row.
    accuracies : tuple of float
        Targets to measure each row at [-].
    say, tick : functions
        Told what is going on, and of each frame.
    """
    context, case = create_context(), comparison()
    references: dict[tuple[int, int], Sums | None] = {}
    rows = []
    for beams, bins, width, height, paper_ms in PAPER:
        if (width, height) not in references:
            references[width, height] = _reference(case, beams, width, height, say)
        reference = references[width, height]
        for accuracy in accuracies:
            row: dict[str, Any] = {
                "beams": beams, "bins": bins, "fan_deg": [width, height], "accuracy": accuracy, "paper_ms": paper_ms,
            }  # fmt: skip
            rows.append(row | _measure(context, case, row, reference, samples, tick))
    return rows


def settings_of(row: dict[str, Any], normalization: str) -> ForwardLookingSettings:
    """Settings of a row of the tables."""
    return ForwardLookingSettings.model_validate(
        {
            "range": RANGE, "bin_count": row["bins"], "beam_count": row["beams"], "accuracy": row["accuracy"],
            "beam_width": float(np.radians(row["fan_deg"][0])), "beam_height": float(np.radians(row["fan_deg"][1])),
            "normalization": normalization,
        }
    )  # fmt: skip


def _measure(
    context: Context, case: Case, row: dict[str, Any], reference: Sums | None, samples: int, tick: Callable[[], None]
) -> dict[str, Any]:
    images = {}
    for normalization in ("energy", "mean"):
        sonar = ForwardLookingSonar(context, settings_of(row, normalization))
        images[normalization] = sonar.ping(case.world, case.pose).bins.astype(np.float64)
        if normalization == "mean":
            times = time_frames(lambda: sonar.ping(case.world, case.pose), samples, tick)  # noqa: B023 (called at once)
        sonar.release()
    found = times.data()
    if reference is not None:
        joined = reference.coarser(len(reference.beam) // row["beams"], _FINEST_BINS // row["bins"])
        wrong = errors(joined, images["energy"], images["mean"])
        found |= {
            "energy_error": wrong.energy, "mean_error": wrong.mean, "missed": wrong.missed, "false": wrong.false,
        }  # fmt: skip
    return found


def _reference(case: Case, beams: int, width: float, height: float, say: Callable[[str], None]) -> Sums | None:
    """The finest of the images that share a fan; None without embreex."""
    table = equal_angle(1 if beams == 1 else _FINEST_BEAMS, float(np.radians(width)), float(np.radians(height)))
    try:
        return converged(
            case.world,
            case.pose.transform(),
            table,
            RANGE,
            _FINEST_BINS,
            sigmoid,
            lambda line: say(f"reference: {line}"),
        )
    except RuntimeError as error:
        say(f"no errors for {width} x {height} deg: {error}")
        return None


def sigmoid(strength: Any) -> Any:
    """The paper's S with its own constants, float64."""
    return 1.0 / (1.0 + np.exp(-18.0 * (strength - 2.0 / 3.0)))
