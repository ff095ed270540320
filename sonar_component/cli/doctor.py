"""`sonar doctor`: whether this machine renders a right image, and if not, what is missing."""

from __future__ import annotations

import json
import platform
import time
from collections.abc import Callable, Iterator
from typing import Any

import typer

Finding = tuple[str, bool, str]


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("doctor")(doctor)


def doctor(
    device: int | None = typer.Option(None, help="EGL device to look at; the first by default."),
    as_json: bool = typer.Option(False, "--json", help="Print the findings for machines."),
) -> None:
    """Render a known target and say in words whether everything is right."""
    findings = list(_findings(device))
    good = all(passed for _, passed, _ in findings)
    if as_json:
        rows = [{"check": name, "passed": passed, "words": words} for name, passed, words in findings]
        print(json.dumps({"good": good, "findings": rows}))
    else:
        for name, passed, words in findings:
            print(f"{'good' if passed else 'BAD '}  {name}: {words}")
        print("All is well." if good else "Something is wrong: see the lines marked BAD.")
    raise typer.Exit(0 if good else 1)


def _findings(device: int | None) -> Iterator[Finding]:
    yield "python", True, f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    yield _checked("ports", _ports)
    from sonar_component.gl import GLUnavailableError, create_context, is_software

    try:
        context = create_context(device)
    except GLUnavailableError as error:
        yield "EGL", False, str(error)
        return
    yield "EGL", True, "a headless context opens, without display"
    kind = "on the CPU" if is_software(context) else "on a graphics card"
    yield "renderer", True, f"{context.info['GL_RENDERER']}, OpenGL {context.version_code / 100:g}, {kind}"
    yield _checked("targets", lambda: _targets(context))
    began = time.perf_counter()
    yield from _known_target(context)
    yield "first image", True, f"took {time.perf_counter() - began:.2f} s, compiling included"


def _checked(name: str, check: Callable[[], str]) -> Finding:
    try:
        return name, True, check()
    except Exception as error:
        # Whatever a driver or a library throws is the finding.
        return name, False, f"{type(error).__name__}: {error}"


def _known_target(context: Any) -> list[Finding]:
    from sonar_component.sonars.self_test import known_target

    try:
        return known_target(context)
    except Exception as error:
        return [("image", False, f"{type(error).__name__}: {error}")]


def _ports() -> str:
    from sonar_component.middleware.transport.check import loopback

    return loopback()


def _targets(context: Any) -> str:
    from sonar_component.gl import Target

    target = Target(context, 64, 32, 2)
    target.pixels[:] = 7
    target.clear()
    if target.read().any():
        raise RuntimeError("an integer target cannot be cleared and read back")
    target.release()
    return "integer targets carry samples unchanged"
