"""Make the pictures of deploy: run each experiment, take a snapshot, keep the file small.

.venv/bin/python tools/make_gallery.py [NAME ...]        writes deploy/NAME.png

The picture "demo" is made by the command that stands beside it in the README.
"""

from __future__ import annotations

import os
import re
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parent.parent
DEPLOY = ROOT / "deploy"
PORTS = {
    "fls_target": "fls.sonar_samples",
    "fls_isolation_valve": "fls.sonar_samples",
    "fls_docking": "fls.sonar_samples",
    "msis_tank": "msis_top.sonar_samples",
    "msis_grid_turning": "msis_top.sonar_samples",
    "msis_slope": "msis_back.sonar_samples",
}
COLOURS, WIDTH = 160, 720  # [-], [pixels]: 40 to 90 kB a picture
DEMO_WIDTH = 900  # [pixels], as it is drawn: the first thing that people see of this project
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
    keep(picture, WIDTH)


def make_demo(folder: Path) -> None:
    """The ping whose command the README shows."""
    found = re.search(r"Made by `sonar (ping .*?)`", " ".join((ROOT / "README.md").read_text().split()))
    if found is None:
        raise SystemExit("README.md names no command that makes deploy/demo.png")
    arguments = shlex.split(found[1])
    arguments[arguments.index("--out") + 1] = str(folder / "demo.png")
    subprocess.run(sonar(*arguments), cwd=ROOT, check=True)
    keep(folder / "demo.png", DEMO_WIDTH)


def keep(picture: Path, width: int) -> None:
    """A small copy in deploy: few colours, and no wider than it is shown."""
    image = Image.open(picture).convert("RGB")
    image.thumbnail((width, width), Image.Resampling.LANCZOS)
    image.quantize(COLOURS, dither=Image.Dither.NONE).save(DEPLOY / picture.name, optimize=True)
    print(f"deploy/{picture.name}: {(DEPLOY / picture.name).stat().st_size // 1024} kB")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as scratch:
        for chosen in sys.argv[1:] or ("demo", *PORTS):
            if chosen == "demo":
                make_demo(Path(scratch))
            else:
                make(chosen, Path(scratch))
