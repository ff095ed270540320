"""What a frame costs as the sonar and the scene grow."""

from __future__ import annotations

import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from sonar_component.cli.benchmarks.scenes import Case, comparison, crowd, plain, tank
from sonar_component.cli.benchmarks.tables import RANGE
from sonar_component.cli.benchmarks.timing import time_frames
from sonar_component.gl import Context, create_context
from sonar_component.sonars import feature_costs
from sonar_component.sonars.forward_looking import ForwardLookingSonar
from sonar_component.sonars.load_cost import load_costs
from sonar_component.sonars.settings import ForwardLookingSettings

_START = """
import time; began = time.perf_counter()
from sonar_component.cli.benchmarks.scenes import comparison
from sonar_component.gl import create_context
from sonar_component.sonars.forward_looking import ForwardLookingSonar
from sonar_component.sonars.settings import ForwardLookingSettings
imported = time.perf_counter()
case = comparison()
sonar = ForwardLookingSonar(create_context(), ForwardLookingSettings(range=30, bin_count=500))
sonar.ping(case.world, case.pose)
print(imported - began, time.perf_counter() - imported)
"""
_FLAT_FRAMES = 10_000  # [frames], over which memory must not grow


def run(frames: int, say: Callable[[str], None], tick: Callable[[], None]) -> Any:
    """Rows of what was varied, its value, and the times."""
    context = create_context()
    deg = np.pi / 180
    rows = []

    def row(name: str, value: float, case: Case, note: str = "", **settings: Any) -> None:
        rows.append({"varied": name, "value": value, "note": note} | _cost(context, case, settings, frames))
        tick()

    for beams in (1, 64, 128, 256, 512, 1024):
        row("beams", beams, comparison(), beam_count=beams)
    for bins in (125, 250, 500, 1000, 2000):
        row("bins", bins, comparison(), bin_count=bins)
    for width in (30, 60, 120, 180, 270, 360):
        row("fan width [deg]", width, tank(), beam_width=width * deg)
    for count in (0, 100, 1000):
        row("objects", count + 2, crowd(count))
    for noise in (False, True):
        row("speckle noise", float(noise), comparison(), enable_speckle_noise=noise)
    # Denser and denser, the same floor; then a world that grows while what is in sight stays the same.
    for triangles in (8_000, 32_000, 128_000):
        row("triangles in 80 x 80 m", triangles, plain(triangles, 80.0))
    # 21 triangles per m2: 20 000 lie in the sector.
    for triangles, size in ((136_000, 80.0), (250_000, 108.5), (500_000, 153.5)):
        row("triangles in the world, 21 per m2", triangles, plain(triangles, size))
    say("features, loading, cold start")
    return {
        "rows": rows, "features": feature_costs.benchmark(context, frames, tick), "loading": load_costs(tick=tick),
        "start": _cold_start(), "memory": _memory(context, tick),
    }  # fmt: skip


def _cost(context: Context, case: Case, changed: dict[str, Any], frames: int) -> dict[str, float]:
    settings = ForwardLookingSettings.model_validate({"range": RANGE, "bin_count": 500} | changed)
    sonar = ForwardLookingSonar(context, settings)
    rng = np.random.default_rng(0)  # used only where settings enable noise
    times = time_frames(lambda: sonar.ping(case.world, case.pose, rng), frames).data()
    sonar.release()
    return times


def _cold_start() -> dict[str, float]:
    """Seconds that a fresh process takes to import, and then to its first frame."""
    found = subprocess.run([sys.executable, "-c", _START], capture_output=True, text=True, check=True)
    imports, first = (float(word) for word in found.stdout.split())
    return {"imports_s": imports, "first_frame_s": first}


def _memory(context: Context, tick: Callable[[], None]) -> dict[str, float]:
    """Growth of the process over many frames [MB]."""
    case = comparison()
    sonar = ForwardLookingSonar(context, ForwardLookingSettings(range=RANGE, bin_count=500, accuracy=0.1))
    for _ in range(500):
        sonar.ping(case.world, case.pose)
    before = _resident()
    for frame in range(_FLAT_FRAMES):
        sonar.ping(case.world, case.pose)
        if frame % 1000 == 0:
            tick()
    sonar.release()
    return {"frames": _FLAT_FRAMES, "grown_mb": _resident() - before}


def _resident() -> float:
    """Memory of this process now [MB]."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize() / 1e6
