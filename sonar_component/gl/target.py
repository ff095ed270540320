"""An off-screen integer target with depth, read back into an array that is kept between frames."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray


class Target:
    """A (rows, columns, components) uint32 image to draw into.

    Integer texels carry packed bits unchanged: a float target may rewrite those that look like a NaN.
    """

    def __init__(self, context: moderngl.Context, columns: int, rows: int, components: int) -> None:
        self._screen = context.detect_framebuffer(0)
        self.texture = context.texture((columns, rows), components, dtype="u4")
        self.texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._depth = context.depth_renderbuffer((columns, rows))
        self.framebuffer = context.framebuffer([self.texture], self._depth)
        self.pixels: NDArray[np.uint32] = np.zeros((rows, columns, components), np.uint32)

    def clear(self) -> None:
        """Make it current, empty (0: no surface) and farthest."""
        self.framebuffer.use()
        self.framebuffer.clear(0.0, 0.0, 0.0, 0.0)

    def read(self) -> NDArray[np.uint32]:
        """Wait for the drawing and copy the image; row 0 is the bottom. The array is overwritten by the next read."""
        rows, columns, components = self.pixels.shape
        self.framebuffer.read_into(self.pixels, viewport=(0, 0, columns, rows), components=components, dtype="u4")
        return self.pixels

    def release(self) -> None:
        """Give the GPU memory back."""
        # moderngl binds the last framebuffer again when it makes another one, and one that is gone is a GL error.
        self._screen.use()
        self.framebuffer.release()
        self.texture.release()
        self._depth.release()
