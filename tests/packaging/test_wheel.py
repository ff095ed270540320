"""What users install: the wheel, alone in a fresh environment, in an empty folder."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import sysconfig
import time
import venv
import zipfile
from email.parser import Parser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
INSTALLED = "sonar_component/data"  # where the wheel holds configs/ and deploy/


def clean_environment() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL_ENV"))}


def run(*command: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(
        [*map(str, command)], cwd=cwd, env=clean_environment(),
        capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    run(sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", folder, ROOT, cwd=folder)
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """bin/ of an environment that holds the wheel; what it depends on is taken from ours, the package is not."""
    home = tmp_path_factory.mktemp("fresh")
    venv.create(home, with_pip=False)
    python = home / "bin" / "python"
    run(
        sys.executable,
        "-m",
        "pip",
        "--python",
        python,
        "install",
        "--quiet",
        "--no-deps",
        "--no-index",
        wheel,
        cwd=home,
    )
    (site,) = home.glob("lib/python*/site-packages")
    # A folder named in a .pth file is only searched: the .pth file of our editable install in it is not read.
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return home / "bin"


def files_below(folder: Path) -> set[str]:
    return {
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts and path.suffix not in (".nbi", ".nbc")
    }


def test_the_wheel_holds_every_file_of_the_package_and_what_its_commands_name(wheel: Path) -> None:
    held = set(zipfile.ZipFile(wheel).namelist())
    for folder, place in (
        ("sonar_component", "sonar_component"),
        ("configs", f"{INSTALLED}/configs"),
        ("deploy", f"{INSTALLED}/deploy"),
    ):
        missing = {f"{place}/{name}" for name in files_below(ROOT / folder)} - held
        assert not missing, sorted(missing)
    assert "sonar_component/py.typed" in held
    assert any(name.endswith(".frag") for name in held)


def test_the_wheel_holds_nothing_else(wheel: Path) -> None:
    tops = {name.split("/")[0] for name in zipfile.ZipFile(wheel).namelist()}
    assert len(tops) == 2
    assert {top for top in tops if not top.endswith(".dist-info")} == {"sonar_component"}


def test_the_wheel_says_which_python_and_which_packages_it_needs(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        (name,) = [name for name in archive.namelist() if name.endswith(".dist-info/METADATA")]
        metadata = Parser().parsestr(archive.read(name).decode())
    assert metadata["Requires-Python"] == ">=3.10"
    needed = [line for line in metadata.get_all("Requires-Dist", []) if "extra" not in line]
    assert all(">=" in line for line in needed), needed
    assert {"test", "viewer", "reference"} <= set(metadata.get_all("Provides-Extra", []))


def test_the_commands_run_from_the_wheel_and_not_from_this_checkout(installed: Path, tmp_path: Path) -> None:
    where = run(installed / "python", "-c", "import sonar_component as s; print(s.__file__)", cwd=tmp_path).stdout
    assert Path(where.strip()).is_relative_to(installed.parent)


def test_an_empty_folder_is_enough_for_a_ping(context: Any, installed: Path, tmp_path: Path) -> None:
    done = run(
        installed / "sonar", "ping", "--scene", "configs/scenes/wreck_site/scene.yaml",
        "--sonar", "configs/sonars/gemini_720i.yaml", "--position", -3, -1, -11.5, "--rpy-deg", 0, 22, 0,
        "--out", "wreck.npz", cwd=tmp_path,
    )  # fmt: skip
    assert "256 beams x 500 bins" in done.stdout
    with np.load(tmp_path / "wreck.npz") as image:
        assert 0.1 < (image["bins"] > 0).mean() < 0.9  # wreck and sand, and shadows
    assert [path.name for path in tmp_path.iterdir()] == ["wreck.npz"]


def test_every_deployment_is_found_and_good(installed: Path, tmp_path: Path) -> None:
    names = [f"deploy/{path.name}" for path in sorted((ROOT / "deploy").glob("*.yaml"))]
    done = run(installed / "sonar", "check", *names, cwd=tmp_path)
    assert done.stdout.count(": good: ") == len(names)


def test_the_demo_runs_from_the_wheel(context: Any, installed: Path, tmp_path: Path) -> None:
    environment = {
        **clean_environment(),
        "SONAR_RUN_DIR": str(tmp_path / "run"),
        "SONAR_LOG_DIR": str(tmp_path / "logs"),
    }
    command = [str(installed / "sonar"), "run", "deploy/demo.yaml", "--set", "viewer.port=0"]
    with (tmp_path / "said").open("w+") as said:
        launcher = subprocess.Popen(command, cwd=tmp_path, env=environment, stdout=said, stderr=said)
        end = time.monotonic() + 60  # [s], for four processes to come up on a busy machine
        tasks = ("scene", "pose", "fls", "viewer")
        while not all(f"{task}: RUNNING" in (tmp_path / "said").read_text() for task in tasks):
            assert time.monotonic() < end, (tmp_path / "said").read_text()
            time.sleep(0.1)
        launcher.send_signal(signal.SIGINT)
        launcher.wait(30)
