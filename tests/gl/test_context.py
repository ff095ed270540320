"""Contexts on this machine's own driver, and what is said where there is none."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from sonar_component.gl import GLUnavailableError, create_context, is_software

OPEN = "from sonar_component.gl import create_context; create_context(); print('opened')"


def open_in_another_process(**environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", OPEN],
        env={**os.environ, **environment}, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip


def test_a_context_has_the_version_that_compute_shaders_need(context: Any) -> None:
    assert context.version_code >= 430


def test_no_display_is_needed(context: Any) -> None:
    done = open_in_another_process(DISPLAY="", WAYLAND_DISPLAY="")
    assert done.stdout == "opened\n", done.stderr


def test_software_is_told_from_hardware_by_the_renderer_s_name(context: Any) -> None:
    assert is_software(context) == any(name in context.info["GL_RENDERER"] for name in ("llvmpipe", "softpipe"))


def test_two_contexts_live_side_by_side_and_are_given_back(context: Any) -> None:
    other = create_context()
    buffer = other.buffer(b"abcd")
    with context:
        mine = context.buffer(b"wxyz")
        assert mine.read() == b"wxyz"
        mine.release()
    with other:
        assert buffer.read() == b"abcd"
    other.release()


def test_a_device_that_is_not_there_is_refused_by_its_number(context: Any) -> None:
    with pytest.raises(GLUnavailableError, match="device 99") as caught:
        create_context(99)
    assert "apt-get" not in str(caught.value)  # nothing to install would bring it


def test_without_a_vendor_library_one_line_says_what_to_install(context: Any, tmp_path: Path) -> None:
    # libglvnd asks the files in this folder for drivers: an empty one is a machine without Mesa.
    done = open_in_another_process(__EGL_VENDOR_LIBRARY_DIRS=str(tmp_path))
    assert "apt-get install" in done.stderr.splitlines()[-1]


def test_without_the_egl_library_one_line_says_what_to_install(context: Any, tmp_path: Path) -> None:
    for name in ("libEGL.so", "libEGL.so.1"):
        (tmp_path / name).write_bytes(b"not a library")  # found first, and refused by the loader
    done = open_in_another_process(LD_LIBRARY_PATH=str(tmp_path))
    assert "apt-get install" in done.stderr.splitlines()[-1]
    assert "libEGL" in done.stderr.splitlines()[-1]
