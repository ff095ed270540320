"""Measures the live page: age of what it draws, images drawn a second, memory of the viewer over time.

    .venv/bin/python tools/measure_viewer.py [--seconds 60] [--rate 15] [--tabs 1] [--deployment FILE]

Runs a deployment (by default a forward-looking sonar of 256 x 500 on the demo's wreck, its poses at the asked rate),
opens its page in headless Chromium, and prints JSON. Needs: sudo apt-get install chromium chromium-driver
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import psutil
from selenium import webdriver
from selenium.webdriver.chrome.service import Service

SOURCE = "fls.sonar_samples"
SETTLING = 10.0  # [s] left out: compilers, caches and the browser's first drawing
FLAGS = (
    "--headless=new --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync --window-size=1400,1000"
)
DEPLOYMENT = """
version: 1
name: measure_viewer
tasks:
  scene: {{type: SceneTask, properties: {{world: configs/scenes/wreck_site/scene.yaml}}}}
  pose:
    type: VehiclePoseTask
    activity: {{periodic: {period} ms}}
    properties:
      position: [14 m, 0 m, -8 m]
      rpy: [0 deg, 15 deg, 0 deg]
      trajectory: {{kind: circle, radius: 14 m, speed: 0.5 m/s, look: inwards}}
  fls: {{type: MultibeamSonarTask, properties: {{range: 30 m, beam_count: 256, bin_count: 500}}}}
  viewer: {{type: ViewerTask, properties: {{port: 0}}}}
connections:
  - {{from: pose.pose_samples, to: [fls.sonar_pose_cmd], policy: data}}
  - {{from: fls.sonar_samples, to: [viewer.sonar_samples], policy: {{circular_buffer: 4}}}}
"""


def sonar(*arguments: str) -> Any:
    done = subprocess.run(
        [sys.executable, "-m", "sonar_component", *arguments], capture_output=True, text=True, check=False
    )
    return json.loads(done.stdout) if done.returncode == 0 else None


def wait_for_page() -> str:
    for _ in range(60):
        if found := sonar("view", "--json"):
            return str(found["page"])
        time.sleep(0.5)
    raise SystemExit("no page within 30 s")


def open_browser() -> webdriver.Chrome:
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or "chromium"
    for flag in FLAGS.split():
        options.add_argument(flag)
    return webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))


def cpu(processes: list[psutil.Process]) -> float:
    """Processor time that processes have used so far [s]; ones that are gone count no more."""
    used = 0.0
    for process in processes:
        with contextlib.suppress(psutil.Error):
            times = process.cpu_times()
            used += times.user + times.system
    return used


def measure(page: str, seconds: float, tabs: int) -> dict[str, Any]:
    tasks = sonar("list", "--json")["tasks"]
    viewer = next(task for task in tasks if task["type"] == "ViewerTask")
    process, browser = psutil.Process(viewer["pid"]), open_browser()
    try:
        for number in range(tabs):
            if number:
                browser.switch_to.new_window("window")
            browser.get(page)
        for _ in range(60):
            if browser.execute_script(f"return document.querySelector(\"[data-source='{SOURCE}']\")?.dataset.age"):
                break
            time.sleep(0.5)
        else:
            raise SystemExit(f"the page drew no image of {SOURCE} within 30 s; see: sonar list")
        time.sleep(SETTLING)
        service = psutil.Process(browser.service.process.pid)
        groups = {
            "viewer": [process],
            "sonar": [psutil.Process(task["pid"]) for task in tasks if task["type"] == "MultibeamSonarTask"],
            "browser": service.children(recursive=True),
        }
        before = {name: cpu(group) for name, group in groups.items()}
        ages, memory, times, drawn = [], [], [], []
        script = (
            f"const p = document.querySelector(\"[data-source='{SOURCE}']\");"
            "return [Number(p.dataset.age), Number(p.dataset.drawn)]"
        )
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            age, count = browser.execute_script(script)
            ages.append(age * 1000)
            drawn.append(count)
            times.append(time.monotonic())
            memory.append(process.memory_info().rss / 1e6)
            time.sleep(0.2)
        used = {name: cpu(group) - before[name] for name, group in groups.items()}
    finally:
        browser.quit()
    slope = float(np.polyfit(times, memory, 1)[0]) * 3600
    return {
        "age_ms": {name: round(float(np.percentile(ages, p)), 1) for name, p in (("median", 50), ("p95", 95))},
        "drawn_hz": round((drawn[-1] - drawn[0]) / (times[-1] - times[0]), 2),
        "cpu_ms_per_image": {name: round(1000 * s / max(drawn[-1] - drawn[0], 1), 1) for name, s in used.items()},
        "viewer_memory_mb": {
            "first": round(memory[0], 1),
            "last": round(memory[-1], 1),
            "slope_per_hour": round(slope, 1),
        },
        "tabs": tabs,
        "seconds": seconds,
        "load_average": os.getloadavg()[0],
        "cores": os.cpu_count(),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=15.0)
    parser.add_argument("--tabs", type=int, default=1)
    parser.add_argument("--deployment", type=Path)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["SONAR_RUN_DIR"] = folder  # whatever else runs on this machine is another graph
        file = given.deployment
        if file is None:
            file = Path(folder) / "measure_viewer.yaml"
            file.write_text(DEPLOYMENT.format(period=1000 / given.rate))
        launcher = subprocess.Popen(
            [sys.executable, "-m", "sonar_component", "run", str(file)], stdout=subprocess.DEVNULL
        )
        try:
            print(json.dumps(measure(wait_for_page(), given.seconds, given.tabs), indent=2))
        finally:
            launcher.terminate()
            launcher.wait(15)


if __name__ == "__main__":
    main()
