"""Draws the samples of a fan: for each cell of the layout range, extent in range, echo strength."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from sonar_component.gl import Target, load_program, set_uniforms
from sonar_component.render import tiles
from sonar_component.render.geometry import Geometry
from sonar_component.render.layout import Layout, View

Array = NDArray[np.float64]

_DRAWN_BEYOND = 1.25  # [-], of the range: a cell whose centre lies beyond the last bin may still reach into it
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
    """

    range_max: float
    bin_length: float
    sigmoid: tuple[float, float] | None = None
    attenuation: float = 0.0
    truth: bool = False


class FootprintRenderer:
    """Program, target and draw commands for one layout; compiled again only when features change."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._program: moderngl.Program | None = None
        self._features: dict[str, object] = {}
        self._array: moderngl.VertexArray | None = None
        self._target: Target | None = None
        self._indirect: moderngl.Buffer | None = None
        self.geometry = Geometry(context)

    def draw(self, X_WS: Array, layout: Layout, optics: Optics) -> Target:
        """Draw the world in ``geometry`` as seen from a sonar at X_WS (4, 4) [m]; returns the target to read."""
        self._prepare(layout, optics)
        assert self._target is not None
        self._target.clear()
        if self.geometry.empty:
            return self._target
        assert self._program is not None
        assert self._array is not None
        centres = self.geometry.place(X_WS)
        self._set_uniforms(optics)
        self._context.enable_only(moderngl.DEPTH_TEST)
        far = _DRAWN_BEYOND * optics.range_max
        chosen = [self._visible(view, layout, centres, far) for view in layout.views]
        commands = self._send_commands(np.concatenate(chosen))
        first = 0
        for view, visible in zip(layout.views, chosen, strict=True):
            if visible.size:
                self._target.framebuffer.viewport = (0, view.first_column, layout.rows, view.columns)
                set_uniforms(self._program, X_DS=projection(view, layout.rows, near_plane(optics), far))
                self._array.render_indirect(commands, count=visible.size, first=first)
            first += visible.size
        return self._target

    def read(self) -> NDArray[np.uint32]:
        """Read what was drawn last; see shaders/footprint.frag."""
        assert self._target is not None
        return self._target.read()

    def release(self) -> None:
        """Give GPU memory back."""
        for thing in (self._target, self._array, self._program, self._indirect):
            if thing is not None:
                thing.release()
        self.geometry.release()

    def _visible(self, view: View, layout: Layout, centres: Array, far: float) -> NDArray[np.intp]:
        mask = tiles.seen(centres, self.geometry.tile_radius, view.azimuth, view.half_width, -view.y_bottom, far)
        return np.flatnonzero(mask)

    def _send_commands(self, visible: NDArray[np.intp]) -> moderngl.Buffer:
        data = self.geometry.commands(visible)
        if self._indirect is None or self._indirect.size < data.nbytes:
            if self._indirect is not None:
                self._indirect.release()
            self._indirect = self._context.buffer(reserve=max(4096, 2 * data.nbytes))
        if data.size:
            self._indirect.write(data.tobytes())
        return self._indirect

    def _set_uniforms(self, optics: Optics) -> None:
        assert self._program is not None
        values: dict[str, float] = {
            "range_max": optics.range_max,
            "strength_max": strength_max(optics, self.geometry.reflectance_max),
        }
        if optics.sigmoid is not None:
            values["sigmoid_slope"], values["sigmoid_centre"] = optics.sigmoid
        if optics.attenuation:
            values["attenuation"] = optics.attenuation
        set_uniforms(self._program, **values)
        if self.geometry.normal_maps is not None:
            self.geometry.normal_maps.use(0)
            set_uniforms(self._program, normal_maps=0)

    def _prepare(self, layout: Layout, optics: Optics) -> None:
        components = 4 if optics.truth else 2
        shape = (layout.columns, layout.rows, components)
        if self._target is None or self._target.pixels.shape != shape:
            if self._target is not None:
                self._target.release()
            self._target = Target(self._context, layout.rows, layout.columns, components)
        if self.geometry.empty:
            return
        features = self.features(optics)
        if self._program is None or features != self._features:
            self._features = features
            self._program = load_program(
                self._context, _SHADERS, features, vertex_shader="footprint.vert", fragment_shader="footprint.frag"
            )
            self._array = None
        if self._array is None:
            self._array = self._bind(self._program, optics)

    def features(self, optics: Optics) -> dict[str, object]:
        """#defines of the features in use."""
        wanted = {
            "SIGMOID": optics.sigmoid is not None,
            "ATTENUATION": bool(optics.attenuation),
            "NORMAL_MAP": self.geometry.has_normal_maps,
            "TRUTH": optics.truth,
        }
        return {name: 1 for name, on in wanted.items() if on}

    def geometry_changed(self) -> None:
        """The geometry has new buffers: bind them before the next draw."""
        self._array = None

    def _bind(self, program: moderngl.Program, optics: Optics) -> moderngl.VertexArray:
        layout, names = "3f 3f", ["in_position", "in_normal"]
        if self.geometry.has_normal_maps:
            layout, names = layout + " 2f", [*names, "in_uv"]
        instanced = ["4f", "4f", "4f", "1f", "1u" if optics.truth else "4x"]
        instanced.append("1u" if self.geometry.has_normal_maps else "4x")
        of_instance = ["in_X_SM_0", "in_X_SM_1", "in_X_SM_2", "in_reflectance"]
        of_instance += ["in_id"] * optics.truth + ["in_texture_layer"] * self.geometry.has_normal_maps
        content = [
            (self.geometry.vertices, layout, *names),
            (self.geometry.instances, " ".join(instanced) + "/i", *of_instance),
        ]
        return self._context.vertex_array(program, content, index_buffer=self.geometry.indices, index_element_size=4)


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

    A quarter of a bin: seen obliquely, in the corner of an aperture of 120 deg, it is still within the first bin.
    """
    return 0.25 * optics.bin_length


def projection(view: View, rows: int, near: float, far: float) -> bytes:
    """Sonar frame to clip space of one view, as 16 float32 in OpenGL's column order.

    This is the one place where X forward, Y left, Z up turns into OpenGL's axes: x along elevation, y from left to
    right.
    """
    c, s = np.cos(view.azimuth), np.sin(view.azimuth)
    depth = np.array([c, s, 0.0, 0.0])
    right = np.array([s, -c, 0.0, 0.0])
    up = np.array([0.0, 0.0, 1.0, 0.0])
    width, height = view.columns * view.x_step, rows * view.y_step
    X_DS = np.array(
        [
            2 / height * up - (2 * view.y_bottom / height + 1) * depth,
            2 / width * right - (2 * view.x_left / width + 1) * depth,
            (far + near) / (far - near) * depth + np.array([0, 0, 0, -2 * far * near / (far - near)]),
            depth,
        ]
    )
    return X_DS.T.astype(np.float32).tobytes()
