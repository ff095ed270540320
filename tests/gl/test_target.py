"""Integer targets: what is written is what is read, bit for bit."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sonar_component.gl import Target

FULL_SCREEN = """
#version 430
void main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0); }
"""
PLACE_AND_BITS = """
#version 430
out uvec2 texel;
void main() { texel = uvec2(uint(gl_FragCoord.y) * 1000u + uint(gl_FragCoord.x), 0x7fc00001u); }
"""


@pytest.fixture
def target(context: Any) -> Any:
    made = Target(context, 33, 7, 2)  # an odd number of columns: rows are not padded
    yield made
    made.release()


def draw(context: Any, target: Target) -> np.ndarray:
    program = context.program(vertex_shader=FULL_SCREEN, fragment_shader=PLACE_AND_BITS)
    array = context.vertex_array(program, [])
    target.clear()
    array.render(mode=context.TRIANGLES, vertices=3)
    pixels = target.read()
    array.release()
    program.release()
    return pixels


def test_row_0_is_the_bottom_and_columns_run_to_the_right(context: Any, target: Target) -> None:
    row, column = np.mgrid[0:7, 0:33]
    np.testing.assert_array_equal(draw(context, target)[:, :, 0], 1000 * row + column)


def test_bits_that_would_be_a_nan_stay_as_they_are(context: Any, target: Target) -> None:
    assert (draw(context, target)[:, :, 1] == 0x7FC00001).all()


def test_clearing_empties_every_texel(context: Any, target: Target) -> None:
    draw(context, target)
    target.clear()
    assert not target.read().any()


def test_the_array_is_kept_between_reads(target: Target) -> None:
    target.clear()
    assert target.read() is target.read()
