"""Samples to beams x bins on the graphics card: only the finished image is read back.

The way for hardware drivers. On llvmpipe its integer atomics are emulated one lane at a time and it takes several times
as long as the compiled loop in binning.py, so a software driver uses that one; `sonar bench` measures both.
"""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from sonar_component.echo.assignment import Assignment
from sonar_component.echo.binning import EMPTY, Scale
from sonar_component.gl import load_program, set_uniforms

_SHADERS = "sonar_component.echo.shaders"
_UNIT = 2.0**31  # [-], of a beam's solid angle: a whole beam in one bin still fits 32 bits, 1e-5 of it are 21 thousand
_ENTRY = np.dtype(
    [
        ("beam", np.uint32),
        ("column", np.uint32),
        ("scale", np.float32),
        ("first_row", np.uint32),
        ("last_row", np.uint32),
        ("first_clip", np.float32),
        ("last_clip", np.float32),
        ("padding", np.float32),
    ]
)
_GROUP = 64  # [-], local size of both shaders
_MAX_GROUPS = 65535  # [-], that OpenGL guarantees per direction


class GpuReduction:
    """Programs and buffers; tables are sent when they change, nothing else is sent per image.

    Use it on the thread that made the context.
    """

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._bin = load_program(context, _SHADERS, compute_shader="bin.comp")
        self._normalise = load_program(context, _SHADERS, compute_shader="normalise.comp")
        self._buffers: list[moderngl.Buffer] = []
        self._tables: tuple[Any, ...] = ()

    def bins(
        self,
        samples: moderngl.Texture,
        layout: Any,
        assignment: Assignment,
        solid_angle: NDArray[np.float64],
        scale: Scale,
    ) -> NDArray[np.float32]:
        """Spread the footprints of all samples over beams x bins: see ``binning.bin_footprints``.

        Parameters
        ----------
        samples : texture of (columns, rows) uint32 pairs
            As the fragment shader writes them.

        Returns
        -------
        (beams, bin_count) float32
        """
        beams = len(solid_angle)
        self._send_tables(layout, assignment, solid_angle, scale.bin_count)
        for place, buffer in enumerate(self._buffers, start=1):
            buffer.bind_to_storage_buffer(place)
        samples.use(0)
        per_metre = scale.bin_count / scale.range_max
        set_uniforms(
            self._bin, samples=0, bin_count=scale.bin_count, rows=layout.rows, bins_per_metre=per_metre,
            linear=scale.linear, lowest_bin=int(np.ceil(scale.min_range * per_metre - 1e-6)),
        )  # fmt: skip
        entries = len(assignment.column)
        wide = min(max(entries, 1), _MAX_GROUPS)
        self._bin.run(-(-layout.rows // _GROUP), wide, -(-entries // wide))
        self._context.memory_barrier(moderngl.SHADER_STORAGE_BARRIER_BIT)
        total = beams * scale.bin_count
        set_uniforms(
            self._normalise, bin_total=total, empty=int(EMPTY * _UNIT), strength_max=scale.strength_max, mean=scale.mean
        )
        groups = -(-total // _GROUP)
        self._normalise.run(min(groups, _MAX_GROUPS), -(-groups // _MAX_GROUPS))
        self._context.memory_barrier(moderngl.BUFFER_UPDATE_BARRIER_BIT | moderngl.SHADER_STORAGE_BARRIER_BIT)
        bins = np.empty((beams, scale.bin_count), np.float32)
        self._buffers[3].read_into(bins)
        return bins

    def _send_tables(
        self, layout: Any, assignment: Assignment, solid_angle: NDArray[np.float64], bin_count: int
    ) -> None:
        # Held by reference, not by id(): an id may come back for another object.
        tables = (layout, assignment, solid_angle, bin_count)
        if len(self._tables) == 4 and all(a is b for a, b in zip(tables[:3], self._tables[:3], strict=True)):
            if self._tables[3] == bin_count:
                return
        self._release_tables()
        self._tables = tables
        entries = np.zeros(_padded(len(assignment.column)), _ENTRY)
        used = entries[: len(assignment.column)]
        used["beam"] = np.repeat(np.arange(len(solid_angle)), np.diff(assignment.start))
        used["column"] = assignment.column
        used["scale"] = assignment.share * _UNIT / solid_angle[used["beam"]]
        for name in ("first_row", "last_row", "first_clip", "last_clip"):
            used[name] = getattr(layout, name)[assignment.column]
        total = len(solid_angle) * bin_count
        make = self._context.buffer
        self._buffers = [
            make(entries.tobytes()), make(layout.solid_angle.tobytes()),
            make(np.zeros(2 * total, np.uint32).tobytes()), make(reserve=4 * total),
        ]  # fmt: skip

    def release(self) -> None:
        """Give GPU memory back."""
        self._release_tables()
        self._bin.release()
        self._normalise.release()

    def _release_tables(self) -> None:
        for buffer in self._buffers:
            buffer.release()
        self._buffers, self._tables = [], ()


def _padded(entries: int) -> int:
    """Length of the table that the grid of work groups covers; entries of scale 0 do nothing."""
    wide = min(max(entries, 1), _MAX_GROUPS)
    return wide * max(1, -(-entries // wide))
