"""tools/demo and tools/test before Python is there: options, and what is said where nothing can be installed."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def shell(script: str, folder: Path = ROOT, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["sh", "-c", script], cwd=folder, env={**os.environ, **environment}, stdin=subprocess.DEVNULL,
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip


@pytest.mark.parametrize("name", ["tools/demo", "tools/test", ".ci/run"])
def test_the_scripts_can_be_run_and_are_plain_sh(name: str) -> None:
    assert os.access(ROOT / name, os.X_OK)
    assert (ROOT / name).read_text().startswith("#!/bin/sh\n")
    assert shell(f"sh -n {name} && sh -n tools/setup.sh").returncode == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("--seconds", "--seconds needs a number"),
        ("--seconds=", "--seconds needs a number"),
        ("--seconds soon", "--seconds must be a number of seconds, got soon"),
        ("--seconds -1", "--seconds must be a number of seconds, got -1"),
        ("--seconds 1.2.3", "--seconds must be a number of seconds, got 1.2.3"),
        ("--snapshot", "--snapshot needs a folder"),
        ("--snapshot README.md/out", "--snapshot: cannot make the folder README.md/out"),
        ("--fast", "unknown option --fast; allowed: --seconds N, --snapshot DIR"),
    ],
)
def test_a_wrong_option_gets_one_line_before_anything_is_set_up(arguments: str, message: str) -> None:
    done = shell(f"tools/demo {arguments}")
    assert (done.returncode, done.stdout, done.stderr) == (2, "", f"tools/demo: {message}\n")


@pytest.fixture
def poor(tmp_path: Path) -> str:
    """A PATH on which the user is nobody, sudo asks for a password, and nobody is there to give it."""
    for name, body in (("id", "echo 65534"), ("sudo", "exit 1"), ("apt-get", "exit 1")):
        (tmp_path / name).write_text(f"#!/bin/sh\n{body}\n")
        (tmp_path / name).chmod(0o755)
    return f"{tmp_path}:{os.environ['PATH']}"


def test_without_root_one_line_says_what_to_run(poor: str) -> None:
    done = shell(". tools/setup.sh; apt_install libegl1 libgl1", PATH=poor)
    words = "missing: libegl1 libgl1; get it with: sudo apt-get update && sudo apt-get install -y libegl1 libgl1\n"
    assert (done.returncode, done.stdout, done.stderr) == (1, "", words)


def test_a_python_that_is_too_old_is_refused_by_its_version(tmp_path: Path) -> None:
    old = tmp_path / "python"
    old.write_text('#!/bin/sh\n[ "$1" = -V ] && echo "Python 3.8.1" || exit 1\n')
    old.chmod(0o755)
    done = shell(". tools/setup.sh; find_python", PYTHON=str(old))
    assert done.returncode == 1
    assert done.stderr.startswith("Python 3.10 or later is needed, got Python 3.8.1; choose another with PYTHON=")
    assert done.stderr.count("\n") == 1


def test_a_second_start_asks_pip_nothing(tmp_path: Path) -> None:
    # The stamp of the first start: what pyproject.toml was, and what was installed for.
    (tmp_path / "pyproject.toml").write_text("[project]\n")
    (tmp_path / ".venv").mkdir()
    script = f". {ROOT}/tools/setup.sh; "
    script += "printf '%s\\n%s\\n' \"$(cksum pyproject.toml)\" test,viewer >.venv/installed; "
    script += "has_egl() { true; }; make_venv() { say anew; exit 9; }; setup "
    for extras in ("viewer", "test", "viewer,test"):
        done = shell(script + extras, folder=tmp_path)
        assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert shell(script + "reference", folder=tmp_path).stderr == "anew\n"  # that was not installed yet
    (tmp_path / "pyproject.toml").write_text("[project]\nname = 'x'\n")
    stale = script.replace("$(cksum pyproject.toml)", "another")
    assert shell(stale + "test", folder=tmp_path).stderr == "anew\n"
