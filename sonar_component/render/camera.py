"""What a camera on the vehicle sees under water: colours that fade with distance, haze, light from above.

For people who look at a sonar image and ask what is there; no sonar uses it, and it draws with a context of its own.
The image is the usual sum of attenuated light and veil (Jaffe, IEEE J. Oceanic Eng. 15(2), 1990, without his
point-spread terms): albedo * E(depth) * exp(-c d) + B * (1 - exp(-c d)), per colour, c = absorption + scattering.
"""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from sonar_component.gl import load_program, set_uniforms
from sonar_component.render.draws import everything
from sonar_component.render.geometry import Geometry
from sonar_component.render.packing import instance_format
from sonar_component.render.water import Water as Water
from sonar_component.scene.world import World

Array = NDArray[np.float64]

_SHADERS = "sonar_component.render.shaders"
_READ = ("X_SM", "reflectance")  # of an instance; only sonars read the rest
_NEAR = 0.05  # [m]
_VANISHED = 7.0  # [-] optical lengths: e^-7 is under half a step of 8 bits
_GAMMA = 1 / 2.2  # [-], linear light to sRGB, near enough for a picture that is looked at
_BRIGHT = 0.7  # [-] of full scale, where exposure puts the brightest hundredth of the picture
_MOST_EXPOSURE = 1e4  # [-], for the dark below 100 m


@dataclass(frozen=True)
class View:
    """Size of the picture and opening of the lens.

    Attributes
    ----------
    width, height : int [pixels]
    field_of_view : float
        From the left to the right edge [rad].
    """

    width: int = 640
    height: int = 400
    field_of_view: float = float(np.radians(80.0))

    @property
    def tangent(self) -> tuple[float, float]:
        """Tangents of half the opening, to the side and up [-]."""
        side = float(np.tan(self.field_of_view / 2))
        return side, side * self.height / self.width


class Camera:
    """Draws pictures of a world; keeps program, target and buffers between them."""

    def __init__(self, context: moderngl.Context, view: View | None = None, water: Water | None = None) -> None:
        self._context = context
        self._geometry = Geometry(context)
        self._scene = load_program(context, _SHADERS, vertex_shader="camera.vert", fragment_shader="camera.frag")
        self._open = load_program(context, _SHADERS, vertex_shader="open_water.vert", fragment_shader="open_water.frag")
        self._backdrop = context.vertex_array(self._open, [])
        self._array: moderngl.VertexArray | None = None
        self._generation = -1
        self._screen = context.detect_framebuffer(0)
        self._framebuffer: moderngl.Framebuffer | None = None
        self._images: list[moderngl.Renderbuffer] = []
        self.view, self.water = view or View(), water or Water()

    def draw(self, world: World, X_WC: Array) -> NDArray[np.uint8]:
        """Draw the world from a camera.

        Parameters
        ----------
        world : World
        X_WC : (4, 4) float64
            Pose of the camera in the world [m]; it looks along its X axis, Z is up in the picture.

        Returns
        -------
        (height, width, 3) uint8
            sRGB, row 0 on top, exposed as cameras do it: so that little of the picture is white.
        """
        linear = self.draw_linear(world, X_WC)
        exposure = min(_BRIGHT / max(float(np.percentile(linear.max(axis=2), 99)), 1e-9), _MOST_EXPOSURE)
        return np.asarray(np.clip(linear * exposure, 0, 1) ** _GAMMA * 255 + 0.5, np.uint8)

    def draw_linear(self, world: World, X_WC: Array) -> NDArray[np.float32]:
        """As ``draw``, but linear light as (height, width, 3) float32; 1 is a white surface above the water."""
        self._geometry.update(world)
        target = self._target()
        target.use()
        target.clear(0.0, 0.0, 0.0, 1.0)
        self._set_water(X_WC)
        self._context.disable(moderngl.DEPTH_TEST)
        self._backdrop.render(moderngl.TRIANGLES, vertices=3)
        if not self._geometry.empty:
            # All tiles: a picture now and then does not pay for culling.
            draws = everything(self._geometry.packed)
            commands = self._geometry.send(draws, self._geometry.place(X_WC), np.eye(4)[None])
            self._context.enable_only(moderngl.DEPTH_TEST)
            set_uniforms(self._scene, X_DC=self._projection())
            self._bound().render_indirect(commands, count=len(draws.tiles))
        pixels = np.frombuffer(target.read(components=3, dtype="f4"), np.float32)
        return pixels.reshape(self.view.height, self.view.width, 3)[::-1]

    def release(self) -> None:
        """Give GPU memory back."""
        self._geometry.release()
        self._release_target()
        for thing in (self._array, self._backdrop, self._scene, self._open):
            if thing is not None:
                thing.release()

    def _bound(self) -> moderngl.VertexArray:
        """The world's buffers and the program, bound again whenever the buffers are others."""
        if self._array is None or self._generation != self._geometry.generation:
            g = self._geometry
            assert g.loaded is not None
            instanced, of_instance = instance_format(g.columns, _READ)
            content = [
                (g.loaded.vertices, "3f 3f 8x" if g.textured else "3f 3f", "in_position", "in_normal"),
                (g.instances, instanced, *of_instance),
            ]
            self._array = self._context.vertex_array(
                self._scene, content, index_buffer=g.loaded.indices, index_element_size=4
            )
            self._generation = self._geometry.generation
        return self._array

    def _release_target(self) -> None:
        # As in gl/target.py: moderngl binds the last framebuffer again, and one that is gone is a GL error.
        self._screen.use()
        for thing in (self._framebuffer, *self._images):
            if thing is not None:
                thing.release()
        self._framebuffer, self._images = None, []

    def _target(self) -> moderngl.Framebuffer:
        size = (self.view.width, self.view.height)
        if self._framebuffer is None or self._framebuffer.size != size:
            self._release_target()
            self._images = [self._context.renderbuffer(size, 4, dtype="f4"), self._context.depth_renderbuffer(size)]
            self._framebuffer = self._context.framebuffer(self._images[:1], self._images[1])
        return self._framebuffer

    def _set_water(self, X_WC: Array) -> None:
        depth = max(self.water.surface - float(X_WC[2, 3]), 0.0)
        common = {
            "up_C": tuple(X_WC[2, :3]),
            "camera_depth": depth,
            "absorption": self.water.absorption,
            "scattering": self.water.scattering,
        }
        set_uniforms(self._scene, **common)
        set_uniforms(self._open, tangent=self.view.tangent, **common)

    def _projection(self) -> bytes:
        """Camera frame to clip space as 16 float32 in OpenGL's column order: X forward becomes depth."""
        side, up = self.view.tangent
        clearest = min(self.water.absorption) + self.water.scattering
        far = min(_VANISHED / clearest, 500.0) if clearest > 0 else 500.0
        X_DC = np.array(
            [
                [0.0, -1 / side, 0.0, 0.0],
                [0.0, 0.0, 1 / up, 0.0],
                [(far + _NEAR) / (far - _NEAR), 0.0, 0.0, -2 * far * _NEAR / (far - _NEAR)],
                [1.0, 0.0, 0.0, 0.0],
            ]
        )
        return X_DC.T.astype(np.float32).tobytes()
