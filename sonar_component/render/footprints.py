"""Draws the samples of a fan: for each cell of the layout range, span of ranges, echo strength."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from sonar_component.gl import Target, load_program, set_uniforms
from sonar_component.render.draws import Draws, Sight, choose
from sonar_component.render.geometry import Geometry
from sonar_component.render.layout import Layout, View
from sonar_component.render.packing import instance_format

Array = NDArray[np.float64]

_NEAREST = 1 / 2000  # [-], of the range: depth of 24 bits then parts surfaces that lie 1e-4 of it behind each other
# A cell whose centre lies beyond the last bin may still reach into it: from twice the range on a floor just below the
# horizon. Tiles that lie there altogether cost much and matter little, so they are drawn only as far as a cell reaches
# on a floor that is seen at _FLATTEST, and a quarter of the range at most.
_DRAWN_BEYOND = 2.0  # [-], of the range
_FLATTEST, _MOST_BEYOND = 1 / 32, 0.25  # [rad], [-] of the range
_CLIP_DISTANCE_0 = 0x3000  # GL_CLIP_DISTANCE0, which moderngl does not name
_NORMAL_UNIT, _REFLECTANCE_UNIT = 0, 1  # where the pictures are bound
_PICTURES = {"NORMAL_MAP", "REFLECTANCE_MAP"}
_OF_PICTURES = {"TEXTURED", *_PICTURES}
# Columns of instances that one feature alone reads.
_COLUMN_OF = {
    "band": "WIDE_FAN", "id": "TRUTH", "normal_layer": "NORMAL_MAP", "reflectance_layer": "REFLECTANCE_MAP",
}  # fmt: skip
_CULLED = (True, False, True, False)  # the groups of render/draws.py
_SHADERS = "sonar_component.render.shaders"


@dataclass(frozen=True)
class Optics:
    """What the shader needs besides geometry.

    Attributes
    ----------
    range_max, bin_length : float [m]
    sigmoid : (slope, centre) or None
        The paper's transfer S(i) [-]; None leaves the strength linear.
    attenuation : float
        One way, of the amplitude [Np/m]; 0 leaves the code out of the shader.
    truth : bool
        Whether to write the id of the body too.
    without : names of features
        Left out although they are in use, to measure what they cost.
    """

    range_max: float
    bin_length: float
    sigmoid: tuple[float, float] | None = None
    attenuation: float = 0.0
    truth: bool = False
    without: tuple[str, ...] = ()


@dataclass
class _Program:
    """A compiled program, what it is bound to, and for what its uniforms are set."""

    program: moderngl.Program
    array: moderngl.VertexArray | None = None
    generation: int = -1
    layout: Layout | None = None
    optics: Optics | None = None


class FootprintRenderer:
    """Draws the samples of a layout; a program is compiled once for each set of features that is used."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._programs: dict[tuple[str, ...], _Program] = {}
        self._target: Target | None = None
        self._projected: tuple[Layout, Optics, Array, NDArray[np.float32]] | None = None
        self.geometry = Geometry(context)

    def draw(self, X_WS: Array, layout: Layout, optics: Optics) -> Target:
        """Draw the world in ``geometry`` as seen from a sonar at X_WS (4, 4) [m]; returns the target to read."""
        target = self._prepare_target(layout, optics)
        target.clear()
        if self.geometry.empty:
            return target
        draws, X_SM = self._draws(X_WS, layout, optics)
        X_DS, bands = self._projection(layout, optics)
        defines = self.features(optics, len(layout.views))
        wide = "WIDE_FAN" in defines
        commands = self.geometry.send(draws, X_SM, X_DS, bands if wide else None)
        # A part without pictures is drawn without their code: on llvmpipe a branch around it costs as much as the code.
        plain = {name: value for name, value in defines.items() if name not in _OF_PICTURES}
        first = 0
        for count, features, culled in zip(
            draws.counts.tolist(), (defines, defines, plain, plain), _CULLED, strict=True
        ):
            if count:
                self._enable(wide, culled)
                self._prepare_program(layout, optics, features).render_indirect(commands, count=count, first=first)
            first += count
        return target

    def triangles(self, X_WS: Array, layout: Layout, optics: Optics) -> int:
        """How many triangles ``draw`` would draw, each as often as a view may see it."""
        draws, _ = self._draws(X_WS, layout, optics)
        return int(self.geometry.packed.commands["count"][draws.tiles].sum()) // 3

    def _draws(self, X_WS: Array, layout: Layout, optics: Optics) -> tuple[Draws, Array]:
        view = layout.views[0]
        beyond = min(view.y_step / 2 / _FLATTEST, _MOST_BEYOND)
        near, far = near_plane(optics), (1 + beyond) * optics.range_max
        sight = Sight(layout.azimuths, view.half_width, view.y_step * view.rows / 2, near, far)
        X_SM = self.geometry.place(X_WS)
        return choose(self.geometry.packed, X_SM, sight), X_SM

    def _enable(self, wide: bool, culled: bool) -> None:
        self._context.enable_only(moderngl.DEPTH_TEST | (moderngl.CULL_FACE if culled else 0))
        self._context.front_face = "cw"  # the target's axes are those of a mirror: elevation to the right
        switch = self._context.enable_direct if wide else self._context.disable_direct
        switch(_CLIP_DISTANCE_0)
        switch(_CLIP_DISTANCE_0 + 1)

    @property
    def programs(self) -> list[tuple[str, ...]]:
        """Features of each program that was compiled."""
        return list(self._programs)

    def read(self) -> NDArray[np.uint32]:
        """Read what was drawn last; see shaders/footprint.frag."""
        assert self._target is not None
        return self._target.read()

    def release(self) -> None:
        """Give GPU memory back."""
        if self._target is not None:
            self._target.release()
        for program in self._programs.values():
            program.program.release()
            if program.array is not None:
                program.array.release()
        self.geometry.release()

    def features(self, optics: Optics, views: int = 1) -> dict[str, object]:
        """#defines of the features in use."""
        wanted = {
            "WIDE_FAN": views > 1,
            "SIGMOID": optics.sigmoid is not None,
            "ATTENUATION": bool(optics.attenuation),
            "NORMAL_MAP": self.geometry.has_normal_maps,
            "REFLECTANCE_MAP": self.geometry.has_reflectance_maps,
            "TRUTH": optics.truth,
        }
        defines: dict[str, object] = {name: 1 for name, on in wanted.items() if on and name not in optics.without}
        return defines | ({"TEXTURED": 1} if _PICTURES & defines.keys() else {})

    def _prepare_target(self, layout: Layout, optics: Optics) -> Target:
        components = 4 if optics.truth else 2
        if self._target is None or self._target.pixels.shape != (layout.columns, layout.rows, components):
            if self._target is not None:
                self._target.release()
            self._target = Target(self._context, layout.rows, layout.columns, components)
        return self._target

    def _prepare_program(self, layout: Layout, optics: Optics, defines: dict[str, object]) -> moderngl.VertexArray:
        key = tuple(defines)
        if key not in self._programs:
            sources = {"vertex_shader": "footprint.vert", "fragment_shader": "footprint.frag"}
            self._programs[key] = _Program(load_program(self._context, _SHADERS, defines, **sources))
        program = self._programs[key]
        if program.array is None or program.generation != self.geometry.generation:
            if program.array is not None:
                program.array.release()
            program.array, program.generation = self._bind(program.program, defines), self.geometry.generation
        if program.layout is not layout or program.optics != optics:
            program.layout, program.optics = layout, optics
            set_uniforms(program.program, shear=layout.views[0].shear)
            self._set_features(program.program, layout, optics, defines)
        # Reflectances may have changed with the world.
        set_uniforms(program.program, strength_max=strength_max(optics, self.geometry.reflectance_max))
        self._use_pictures()
        return program.array

    def _projection(self, layout: Layout, optics: Optics) -> tuple[Array, NDArray[np.float32]]:
        """Matrices (views, 4, 4) and bands (views, 2) of the layout, kept as long as it is drawn alike."""
        if self._projected is None or self._projected[0] is not layout or self._projected[1] != optics:
            near, far = near_plane(optics), _DRAWN_BEYOND * optics.range_max
            X_DS = np.array([projection(view, layout.columns, near, far) for view in layout.views])
            bands = np.array([(view.first_column, view.columns) for view in layout.views], np.float32)
            self._projected = (layout, optics, X_DS, bands)
        return self._projected[2], self._projected[3]

    def _set_features(
        self, program: moderngl.Program, layout: Layout, optics: Optics, defines: dict[str, object]
    ) -> None:
        slope, centre = optics.sigmoid or (0.0, 0.0)
        uniforms: dict[str, dict[str, float]] = {
            "WIDE_FAN": {"column_count": float(layout.columns)},
            "SIGMOID": {"sigmoid_slope": slope, "sigmoid_centre": centre},
            "ATTENUATION": {"attenuation": optics.attenuation},
            "NORMAL_MAP": {"normal_maps": _NORMAL_UNIT},
            "REFLECTANCE_MAP": {"reflectance_maps": _REFLECTANCE_UNIT},
        }
        for feature in uniforms.keys() & defines.keys():
            set_uniforms(program, **uniforms[feature])

    def _use_pictures(self) -> None:
        loaded = self.geometry.loaded
        assert loaded is not None
        if loaded.normal_maps is not None:
            loaded.normal_maps.use(_NORMAL_UNIT)
        if loaded.reflectance_maps is not None:
            loaded.reflectance_maps.use(_REFLECTANCE_UNIT)

    def _bind(self, program: moderngl.Program, defines: dict[str, object]) -> moderngl.VertexArray:
        g = self.geometry
        assert g.loaded is not None
        layout, names = "3f 3f", ["in_position", "in_normal"]
        if "TEXTURED" in defines:
            layout, names = layout + " 2f", [*names, "in_uv"]
        elif g.textured:
            layout += " 8x"
        wanted = [name for name in g.columns.names or () if _COLUMN_OF.get(name, "") in ("", *defines)]
        instanced, of_instance = instance_format(g.columns, wanted)
        content = [(g.loaded.vertices, layout, *names), (g.instances, instanced, *of_instance)]
        return self._context.vertex_array(program, content, index_buffer=g.loaded.indices, index_element_size=4)


def strength_max(optics: Optics, reflectance_max: float) -> float:
    """Greatest echo strength that the shader can write [-]."""
    return 1.0 if optics.sigmoid is not None else max(1.0, reflectance_max)


def decode(pixels: NDArray[np.uint32], greatest: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Echo strength [-] and range [m] of samples, (columns, rows) float32 each; range 0 is a miss.

    Parameters
    ----------
    greatest : float
        From ``strength_max``.
    """
    root = (pixels[:, :, 1] & 0xFFFF).astype(np.float32) / np.float32(65535)
    return root * root * np.float32(greatest), np.ascontiguousarray(pixels[:, :, 0]).view(np.float32)


def near_plane(optics: Optics) -> float:
    """Distance below which nothing is drawn [m].

    A quarter of a bin: seen obliquely, in the corner of an aperture of 120 deg, it is still within the first bin. Long
    bins hold many near surfaces, so there it is a share of the range, as small as a depth of 24 bits allows.
    """
    return min(0.25 * optics.bin_length, _NEAREST * optics.range_max)


def projection(view: View, column_count: int, near: float, far: float) -> Array:
    """Sonar frame to clip space of one view, (4, 4) float64.

    This is the one place where X forward, Y left, Z up turns into OpenGL's axes: x along elevation, y from left to
    right over all views of the target.
    """
    c, s = np.cos(view.azimuth), np.sin(view.azimuth)
    depth = np.array([c, s, 0.0, 0.0])
    # Place of a point in the view, in columns from its left edge and rows from its lower one, both times depth.
    column = (np.array([s, -c, 0.0, 0.0]) - view.x_left * depth) / view.x_step
    from_middle = column - view.columns / 2 * depth
    row = np.array([0.0, 0.0, 1.0 / view.y_step, 0.0]) + view.shear * from_middle + view.rows / 2 * depth
    return np.array(
        [
            2 / view.rows * row - depth,
            2 / column_count * (column + view.first_column * depth) - depth,
            (far + near) / (far - near) * depth + np.array([0, 0, 0, -2 * far * near / (far - near)]),
            depth,
        ]
    )
