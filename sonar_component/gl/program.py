"""Programs from .glsl files: features become #defines, compile errors name the file and its line."""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

import moderngl


class ShaderError(RuntimeError):
    """A shader does not compile; the message names the file and the line in it."""


def load_source(package: str, name: str, defines: Mapping[str, object]) -> str:
    """Source of a shader with ``#define`` lines for the features in use.

    Code between ``#ifdef FEATURE`` (or ``#ifndef``) and ``#endif`` of a feature that is off is left out of the text
    itself, so that what a scene does not need is not even there to be compiled.
    """
    text = files(package).joinpath(name).read_text(encoding="utf-8")
    head, _, body = text.partition("\n")
    kept = _strip_unused(body.split("\n"), defines)
    lines = [f"#define {key} {value}" for key, value in defines.items()]
    return "\n".join([head, *lines, *kept])


def _strip_unused(lines: list[str], defines: Mapping[str, object]) -> list[str]:
    kept: list[tuple[int, str]] = []
    stack: list[bool] = []
    for number, line in enumerate(lines, start=2):
        match = re.match(r"\s*#(ifdef|ifndef|else|endif)\s*(\w*)", line)
        if match is None:
            if all(stack):
                kept.append((number, line))
        elif match[1] == "endif":
            stack.pop()
        elif match[1] == "else":
            stack[-1] = not stack[-1]
        else:
            stack.append((match[2] in defines) == (match[1] == "ifdef"))
    out: list[str] = []
    expected = None
    for number, line in kept:
        if number != expected:
            out.append(f"#line {number}")
        out.append(line)
        expected = number + 1
    return out


def load_program(
    context: moderngl.Context, package: str, defines: Mapping[str, object] | None = None, **stages: str
) -> Any:
    """Compile and link a program: a moderngl.Program, or a moderngl.ComputeShader.

    Parameters
    ----------
    package : str
        Python package that holds the files.
    defines : mapping, optional
        Features that are on.
    **stages : str
        ``vertex_shader="x.vert"``, ``fragment_shader="x.frag"``, or ``compute_shader="x.comp"`` alone.

    Raises
    ------
    ShaderError
        With the driver's words, file and line.
    """
    sources = {stage: load_source(package, name, defines or {}) for stage, name in stages.items()}
    try:
        if "compute_shader" in sources:
            return context.compute_shader(sources["compute_shader"])
        return context.program(vertex_shader=sources["vertex_shader"], fragment_shader=sources.get("fragment_shader"))
    except moderngl.Error as error:
        raise ShaderError(f"{', '.join(stages.values())}: {error}") from None


def set_uniforms(program: Any, **values: Any) -> None:
    """Set uniforms by name: bytes as they are, numbers and tuples as values."""
    for name, value in values.items():
        if isinstance(value, bytes):
            program[name].write(value)
        else:
            program[name].value = value
