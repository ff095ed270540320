"""Make the pictures of deploy/README.md: run each experiment, take a snapshot, keep the file small.

.venv/bin/python tools/make_gallery.py [NAME ...]        writes deploy/NAME.png
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from PIL import Image

DEPLOY = Path(__file__).resolve().parent.parent / "deploy"
PORTS = {
    "fls_target": "fls.sonar_samples",
    "fls_isolation_valve": "fls.sonar_samples",
    "fls_docking": "fls.sonar_samples",
    "msis_tank": "msis_top.sonar_samples",
    "msis_grid_turning": "msis_top.sonar_samples",
    "msis_slope": "msis_back.sonar_samples",
}
COLOURS, WIDTH = 160, 720  # [-], [pixels]: 40 to 90 kB a picture
PATIENCE = 60  # [s], for a busy machine to compile and load


def sonar(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "sonar_component", *map(str, arguments)]


def make(name: str, folder: Path) -> None:
    instance, picture = f"gallery_{os.getpid()}", folder / f"{name}.png"
    run = subprocess.Popen(
        sonar("run", DEPLOY / f"{name}.yaml", "--name", instance, "--set", "viewer.port=0"), stdout=subprocess.DEVNULL
    )
    try:
        take = sonar("snapshot", PORTS[name], "--instance", instance, "--out", picture, "--timeout", PATIENCE)
        end = time.monotonic() + PATIENCE
        while subprocess.run(take, check=False, stderr=subprocess.DEVNULL).returncode != 0:
            if time.monotonic() > end or run.poll() is not None:
                raise SystemExit(f"{name}: no picture within {PATIENCE} s")
            time.sleep(1.0)
    finally:
        run.send_signal(signal.SIGINT)
        run.wait(PATIENCE)
    image = Image.open(picture).convert("RGB")
    image.thumbnail((WIDTH, WIDTH), Image.Resampling.LANCZOS)
    image.quantize(COLOURS, dither=Image.Dither.NONE).save(DEPLOY / f"{name}.png", optimize=True)
    print(f"deploy/{name}.png: {(DEPLOY / f'{name}.png').stat().st_size // 1024} kB")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as scratch:
        for chosen in sys.argv[1:] or PORTS:
            make(chosen, Path(scratch))
