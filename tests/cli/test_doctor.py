"""`sonar doctor` on this machine, and on one without drivers."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from sonar_component.cli.app import main


def doctor(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str]:
    with pytest.raises(SystemExit) as caught:
        main(["doctor", *arguments])
    assert isinstance(caught.value.code, int)
    return caught.value.code, capsys.readouterr().out


def test_a_machine_that_renders_right_is_told_so_in_words(context: Any, capsys: pytest.CaptureFixture[str]) -> None:
    code, out = doctor(capsys)
    assert (code, "BAD" in out) == (0, False)
    assert out.endswith("All is well.\n")
    for words in ("EGL: a headless context opens", "OpenGL 4.", "a wall at 6 m stands in the right bin"):
        assert words in out


def test_findings_are_printed_for_machines(context: Any, capsys: pytest.CaptureFixture[str]) -> None:
    code, out = doctor(capsys, "--json")
    report = json.loads(out)
    assert (code, report["good"]) == (0, True)
    checks = [finding["check"] for finding in report["findings"]]
    assert checks == ["python", "ports", "EGL", "renderer", "targets", "range", "energy", "first image"]


def test_a_device_that_is_not_there_is_a_finding(context: Any, capsys: pytest.CaptureFixture[str]) -> None:
    code, out = doctor(capsys, "--device", "99")
    assert code == 1
    assert "BAD   EGL: no EGL device 99" in out


def test_without_drivers_it_says_what_to_install(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "sonar_component", "doctor"],
        env={**os.environ, "__EGL_VENDOR_LIBRARY_DIRS": str(tmp_path)},
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (1, "")
    assert "BAD   EGL: no headless OpenGL 4.3" in done.stdout
    assert "sudo apt-get install libegl1" in done.stdout
    assert done.stdout.endswith("Something is wrong: see the lines marked BAD.\n")


def test_a_wrong_answer_of_the_driver_is_bad(
    context: Any, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # A driver that shows the wall half a metre too near: what doctor is there to find.
    from sonar_component.sonars import self_test

    honest = self_test.wall_ahead
    monkeypatch.setattr(self_test, "wall_ahead", lambda distance: honest(distance - 0.5))
    code, out = doctor(capsys)
    assert code == 1
    assert "BAD   range" in out
