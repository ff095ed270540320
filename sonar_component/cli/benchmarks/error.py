"""Time against error for three ways on one renderer: footprints, one range per sample, one perspective image."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sonar_component.cli.benchmarks.scenes import Case, comparison, grazing, rolling
from sonar_component.cli.benchmarks.tables import sigmoid
from sonar_component.gl import Context, create_context
from sonar_component.sonars.baselines import PointSampler, one_range_per_sample, paper_perspective
from sonar_component.sonars.forward_looking import ForwardLookingSonar
from sonar_component.sonars.reference import Sums, converged, errors
from sonar_component.sonars.settings import ForwardLookingSettings

ACCURACIES = (0.1, 0.05, 0.03, 0.02, 0.01, 0.005)
GRIDS = ((2, 64), (2, 256), (4, 512), (8, 1024), (16, 2048))  # columns per beam, rows
PER_BIN = (2.56, 5.12, 10.24)  # pixels per bin of the perspective image; the paper's is the second
TARGET = 0.02  # [-], energy error at which the ways are compared
_MOST_SECONDS = 2.0  # [s], of frames per point


def run(frames: int, say: Callable[[str], None], tick: Callable[[], None]) -> Any:
    """Points of each way on each scene, and how many times faster ours is at an energy error of TARGET."""
    context = create_context()
    results = []
    for case in (comparison(), grazing(), rolling()):
        settings = ForwardLookingSettings(range=case.range, bin_count=500)
        beams = settings.beam_table()
        reference = converged(
            case.world, case.pose.transform(), beams, case.range, settings.bin_count, sigmoid,
            lambda line: say(f"reference of {case.name}: {line}"),  # noqa: B023 (called at once)
        )  # fmt: skip
        ways: dict[str, list[dict[str, Any]]] = {
            "footprints": [_ours(context, case, settings, reference, a, frames, tick) for a in ACCURACIES]
        }
        grids = [one_range_per_sample(context, settings, beams, *grid) for grid in GRIDS]
        ways["one range per sample"] = [_points(sampler, case, reference, frames, tick) for sampler in grids]
        papers = [paper_perspective(context, settings, beams, per_bin) for per_bin in PER_BIN]
        ways["one perspective image"] = [_points(sampler, case, reference, frames, tick) for sampler in papers]
        results.append({"scene": case.name, "ways": ways, "times_faster_at_0.02": _times_faster(ways)})
    return results


def _ours(
    context: Context, case: Case, settings: ForwardLookingSettings, reference: Sums, accuracy: float, frames: int,
    tick: Callable[[], None],
) -> dict[str, Any]:  # fmt: skip
    images, median = {}, 0.0
    for normalization in ("energy", "mean"):
        changed = settings.model_copy(update={"accuracy": accuracy, "normalization": normalization})
        sonar = ForwardLookingSonar(context, changed)
        images[normalization] = sonar.ping(case.world, case.pose).bins
        if normalization == "mean":
            median = _median(lambda: sonar.ping(case.world, case.pose).bins, frames)  # noqa: B023 (called at once)
        sonar.release()
    tick()
    return {"accuracy": accuracy, "median_ms": median} | _errors(reference, images["energy"], images["mean"])


def _points(
    sampler: PointSampler, case: Case, reference: Sums, frames: int, tick: Callable[[], None]
) -> dict[str, Any]:
    X_WS = case.pose.transform()
    median = _median(lambda: sampler.image(case.world, X_WS, mean=True), frames)
    images = [sampler.image(case.world, X_WS, mean) for mean in (False, True)]
    samples = sampler.layout.columns * sampler.layout.rows
    sampler.release()
    tick()
    return {"samples": samples, "median_ms": median} | _errors(reference, *images)


def _errors(reference: Sums, energy: NDArray[np.float32], mean: NDArray[np.float32]) -> dict[str, float]:
    wrong = errors(reference, energy.astype(np.float64), mean.astype(np.float64))
    return {
        "energy_error": wrong.energy, "mean_error": wrong.mean, "missed": wrong.missed, "false": wrong.false,
    }  # fmt: skip


def _median(image: Callable[[], Any], frames: int) -> float:
    """Of up to so many frames [ms], fewer where a frame is long."""
    image()
    durations: list[float] = []
    began = time.perf_counter()
    while len(durations) < frames and (len(durations) < 3 or time.perf_counter() - began < _MOST_SECONDS):
        start = time.perf_counter()
        image()
        durations.append(time.perf_counter() - start)
    return 1e3 * float(np.median(durations))


def _times_faster(ways: dict[str, list[dict[str, Any]]]) -> float | None:
    """Ratio of the times at equal energy error; None if either way does not reach it."""
    ours, theirs = (_time_at(ways[name]) for name in ("footprints", "one range per sample"))
    return theirs / ours if ours and theirs else None


def _time_at(points: list[dict[str, Any]]) -> float | None:
    """Time at the TARGET energy error, interpolated on logarithmic axes [ms]."""
    ordered = sorted(points, key=lambda point: point["energy_error"])
    wrong = np.log([point["energy_error"] for point in ordered])
    if wrong[0] > np.log(TARGET):
        return None
    return float(np.exp(np.interp(np.log(TARGET), wrong, np.log([point["median_ms"] for point in ordered]))))
