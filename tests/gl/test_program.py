"""Programs from files: features, and errors that can be found in the file."""

from __future__ import annotations

import re
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sonar_component.gl import load_program, set_uniforms
from sonar_component.gl.program import ShaderError, load_source

SCALE = """\
#version 430
layout(local_size_x = 1) in;
layout(std430, binding = 0) readonly buffer Places { vec4 places[]; };
layout(std430, binding = 1) writeonly buffer Seen { vec4 seen[]; };
uniform mat4 X;
uniform float scale;
void main() {
    uint i = gl_GlobalInvocationID.x;
#ifdef DOUBLED
    seen[i] = 2.0 * scale * (X * places[i]);
#else
    seen[i] = scale * (X * places[i]);
#endif
}
"""


BROKEN = "#version 430\nvoid main() {\n#ifdef NEVER\n\n\n#endif\n  nonsense;\n}\n"


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A package with shaders of its own."""
    name = f"shaders_of_{tmp_path.name.replace('-', '_')}"
    (tmp_path / name).mkdir()
    (tmp_path / name / "__init__.py").write_text("")
    (tmp_path / name / "scale.comp").write_text(SCALE)
    (tmp_path / name / "broken.vert").write_text(BROKEN)
    monkeypatch.syspath_prepend(str(tmp_path))
    return name


def transform(context: Any, package: str, defines: dict[str, object], points: np.ndarray) -> np.ndarray:
    program = load_program(context, package, defines, compute_shader="scale.comp")
    X = np.eye(4, dtype=np.float32)
    X[:3, 3] = (10, 20, 30)
    set_uniforms(program, X=X.T.tobytes(), scale=0.5)
    homogeneous = np.concatenate([points, np.ones((len(points), 1))], axis=1).astype(np.float32)
    source, result = context.buffer(homogeneous), context.buffer(reserve=homogeneous.nbytes)
    source.bind_to_storage_buffer(0)
    result.bind_to_storage_buffer(1)
    program.run(len(points))
    answer = np.frombuffer(result.read(), np.float32).reshape(-1, 4)[:, :3].copy()
    for thing in (source, result, program):
        thing.release()
    return answer


def test_uniforms_arrive_as_bytes_and_as_numbers(context: Any, package: str) -> None:
    points = np.array([[0, 0, 0], [1, 2, 3]], np.float64)
    expected = 0.5 * (points + np.array([10, 20, 30]))  # exact in float32: halves of small integers
    np.testing.assert_array_equal(transform(context, package, {}, points), expected)


def test_a_feature_changes_the_program(context: Any, package: str) -> None:
    points = np.array([[1, 2, 3]], np.float64)
    once, doubled = (transform(context, package, features, points) for features in ({}, {"DOUBLED": 1}))
    np.testing.assert_array_equal(doubled, 2 * once)


def test_code_of_a_feature_that_is_off_is_not_even_in_the_text(package: str) -> None:
    assert "2.0 *" not in load_source(package, "scale.comp", {})
    text = load_source(package, "scale.comp", {"DOUBLED": 1})
    assert "2.0 *" in text
    assert "#else" not in text


def test_the_version_stays_the_first_line(package: str) -> None:
    assert load_source(package, "scale.comp", {"DOUBLED": 1, "N": 3}).splitlines()[:3] == [
        "#version 430", "#define DOUBLED 1", "#define N 3",
    ]  # fmt: skip


def test_a_compile_error_names_the_file_and_the_line_in_it(context: Any, package: str) -> None:
    with pytest.raises(ShaderError) as caught:
        load_program(context, package, vertex_shader="broken.vert")
    assert "broken.vert" in str(caught.value)
    assert re.search(r"0[:(]7\b", str(caught.value)), str(caught.value)  # Mesa 0:7(3), NVIDIA 0(7)


def test_every_shader_of_ours_begins_with_its_version_and_says_what_it_computes() -> None:
    shaders = [
        file
        for package in ("sonar_component.render.shaders", "sonar_component.echo.shaders")
        for file in files(package).iterdir()
        if file.name.endswith((".vert", ".frag", ".comp"))
    ]
    assert shaders
    for file in shaders:
        head = file.read_text(encoding="utf-8").splitlines()[:2]
        assert head[0].startswith("#version"), file
        assert head[1].startswith("//"), f"{file} has no header"
