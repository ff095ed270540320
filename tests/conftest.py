"""What tests share: a real GL context, and graphs of real processes with a run directory of their own."""

from __future__ import annotations

import contextlib
import io
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import textwrap
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

_STAND_INS = Path(__file__).parent / "middleware" / "stand_ins.py"
_PATIENCE = 20.0  # [s], for processes to come up on a busy machine of two cores


class Graph:
    """Starts deployments through the real command line and looks at them from outside."""

    def __init__(self, folder: Path, environment: dict[str, str]) -> None:
        self.folder, self.environment = folder, environment
        self.launchers: list[subprocess.Popen[str]] = []

    def write(self, text: str, name: str = "graph.yaml") -> Path:
        path = self.folder / name
        path.write_text(textwrap.dedent(text))
        return path

    def sonar(self, *arguments: object, timeout: float = 60.0) -> subprocess.CompletedProcess[str]:
        """Type a command; all but `run` in this process, where the imports are paid for once."""
        command = [sys.executable, "-m", "sonar_component", *map(str, arguments)]
        if arguments[0] != "run":
            return self._here(command)
        return subprocess.run(
            command, env=self.environment, capture_output=True, text=True, timeout=timeout, check=False
        )

    def _here(self, command: list[str]) -> subprocess.CompletedProcess[str]:
        from sonar_component.cli.app import main

        out, err, code = io.StringIO(), io.StringIO(), 0
        argv = mock.patch.object(sys, "argv", ["sonar", *command[3:]])
        environment = mock.patch.dict(os.environ, self.environment)
        with argv, environment, contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            try:
                main()
            except SystemExit as end:
                code = int(end.code or 0)
        return subprocess.CompletedProcess(command, code, out.getvalue(), err.getvalue())

    def json(self, *arguments: object) -> Any:
        done = self.sonar(*arguments, "--json")
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    def start(self, text: str, *arguments: object, name: str = "graph.yaml") -> subprocess.Popen[str]:
        command = [sys.executable, "-m", "sonar_component", "run", str(self.write(text, name)), *map(str, arguments)]
        with (self.folder / "launcher.out").open("a") as output:
            launcher = subprocess.Popen(command, env=self.environment, stdout=output, stderr=output, text=True)
        self.launchers.append(launcher)
        return launcher

    def said(self) -> str:
        """Everything that the launcher has printed."""
        return (self.folder / "launcher.out").read_text()

    def wait_for(self, what: Callable[[], Any], why: str, patience: float = _PATIENCE) -> Any:
        end = time.monotonic() + patience
        while time.monotonic() < end:
            if result := what():
                return result
            time.sleep(0.02)
        raise AssertionError(f"{why} did not happen within {patience} s; the launcher said:\n{self.said()}")

    def wait_until_said(self, text: str, times: int = 1) -> None:
        self.wait_for(lambda: self.said().count(text) >= times, f"saying {text!r}")

    def processes(self) -> list[int]:
        """Living processes of this graph, launchers left out: known by their run directory."""
        mark = f"SONAR_RUN_DIR={self.environment['SONAR_RUN_DIR']}".encode()
        launchers = {launcher.pid for launcher in self.launchers}
        found = []
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit() and int(entry.name) not in launchers and int(entry.name) != os.getpid():
                try:
                    alive = mark in (entry / "environ").read_bytes().split(b"\0")
                except OSError:
                    continue  # gone, or not ours
                if alive:
                    found.append(int(entry.name))
        return found

    def stop(self) -> None:
        for launcher in self.launchers:
            if launcher.poll() is None:
                launcher.send_signal(signal.SIGTERM)
        for launcher in self.launchers:
            _end(launcher)


def _end(launcher: subprocess.Popen[str]) -> None:
    try:
        launcher.wait(10)
    except subprocess.TimeoutExpired:
        launcher.kill()
        launcher.wait()


@pytest.fixture
def graph(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Graph]:
    run = Path(tempfile.mkdtemp(prefix="sn", dir="/tmp"))  # short: a socket's path has 107 bytes
    packages = tmp_path / "packages"
    declared = packages / "stand_ins-1.0.dist-info"
    declared.mkdir(parents=True)
    shutil.copy(_STAND_INS, packages / "stand_ins.py")
    types = [line.split()[1].split("(")[0] for line in _STAND_INS.read_text().splitlines() if "Task(Task)" in line]
    points = "".join(f"{name} = stand_ins:{name}\n" for name in types)
    (declared / "entry_points.txt").write_text(f"[sonar_component.tasks]\n{points}")
    (declared / "METADATA").write_text("Metadata-Version: 2.1\nName: stand-ins\nVersion: 1.0\n")
    monkeypatch.setenv("SONAR_RUN_DIR", str(run))
    monkeypatch.setenv("SONAR_LOG_DIR", str(tmp_path / "logs"))
    monkeypatch.setenv("PYTHONPATH", str(packages))
    monkeypatch.syspath_prepend(str(packages))
    from sonar_component.middleware.deployment import task_types

    task_types._declared.cache_clear()  # the stand-ins have come since it looked
    graph = Graph(tmp_path, dict(os.environ))
    yield graph
    graph.stop()
    task_types._declared.cache_clear()
    shutil.rmtree(run, ignore_errors=True)


@pytest.fixture(scope="session")
def shared_context() -> Iterator[Any]:
    """One context for all tests: opening one costs 50 ms, and a driver allows only so many."""
    from sonar_component.gl import GLUnavailableError, create_context

    try:
        context = create_context()
    except GLUnavailableError as error:
        pytest.skip(f"needs OpenGL: {error}")  # the error says how to get it
    yield context
    context.release()


@pytest.fixture
def context(shared_context: Any) -> Iterator[Any]:
    """The GL context, current and without errors; a test that leaves an error behind fails, not its neighbour."""
    with shared_context:  # a task under test may have made its own context current
        assert shared_context.error == "GL_NO_ERROR", "the context was dirty before this test"
        yield shared_context
        assert shared_context.error == "GL_NO_ERROR", "this test left the context dirty"
