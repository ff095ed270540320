"""A world's buffers and pictures on the GPU: one copy for all who draw it in one context.

Two sonars of one process have worlds of their own, since each moves its bodies when it comes to it, but the same
meshes; so what is loaded is found by the world's content hash, which leaves the poses out. Sharing between contexts
lost: moderngl's EGL cannot make contexts that share, and drawing in turns costs 4 microseconds (gl/shared.py).
"""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from sonar_component.render.packing import Packed, pack
from sonar_component.scene.world import World

MOST_TEXELS = 1 << 27  # [-], of all layers of one kind: 0.4 GB of normals


class Loaded:
    """Buffers of one world, counted by those who use them."""

    def __init__(self, context: moderngl.Context, packed: Packed) -> None:
        self.users = 0
        self.vertices = context.buffer(packed.vertices)
        self.indices = context.buffer(packed.indices)
        self.normal_maps = _texture_array(context, packed.normal_maps, 3)
        self.reflectance_maps = _texture_array(context, packed.reflectance_maps, 1)
        self.packed = packed.without_bulk()

    @property
    def bytes(self) -> int:
        """Memory of buffers and pictures, with a third more for the smaller versions of pictures."""
        pictures = [t for t in (self.normal_maps, self.reflectance_maps) if t is not None]
        texels = sum(int(np.prod(t.size)) * t.components for t in pictures)
        return int(self.vertices.size + self.indices.size + texels * 4 // 3)

    def release(self) -> None:
        """Give the GPU memory back."""
        for thing in (self.vertices, self.indices, self.normal_maps, self.reflectance_maps):
            if thing is not None:
                thing.release()


def load(context: moderngl.Context, world: World) -> Loaded | None:
    """The world's buffers, made only if nobody has them yet; None where there is nothing to draw.

    Whoever takes them gives them back with ``give_back``.
    """
    shelf, key = _shelf(context), world.content_hash()
    if key not in shelf:
        packed = pack(world)
        if not len(packed.commands):
            return None
        shelf[key] = Loaded(context, packed)
    shelf[key].users += 1
    return shelf[key]


def give_back(context: moderngl.Context, loaded: Loaded) -> None:
    """Use buffers no longer; the last to do so frees them."""
    loaded.users -= 1
    if loaded.users:
        return
    shelf = _shelf(context)
    for key in [key for key, kept in shelf.items() if kept is loaded]:
        del shelf[key]
    loaded.release()


def _shelf(context: moderngl.Context) -> dict[str, Loaded]:
    """What is loaded in this context; moderngl leaves ``extra`` to its users."""
    if context.extra is None:
        context.extra = {}
    shelf: dict[str, Loaded] = context.extra.setdefault("loaded_worlds", {})
    return shelf


def _texture_array(
    context: moderngl.Context, maps: list[NDArray[np.uint8]], components: int
) -> moderngl.TextureArray | None:
    """All pictures at the size of the largest, halved until they fit MOST_TEXELS; wrapped, with mipmaps."""
    if not maps:
        return None
    height, width = (max(image.shape[axis] for image in maps) for axis in (0, 1))
    while height * width * len(maps) > MOST_TEXELS:
        height, width = max(height // 2, 1), max(width // 2, 1)
    # OpenGL's first row is the lowest.
    data = np.stack([_resized(image, height, width)[::-1] for image in maps])
    texture = context.texture_array((width, height, len(maps)), components, data, alignment=1)
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    texture.build_mipmaps()
    return texture


def _resized(image: NDArray[np.uint8], height: int, width: int) -> NDArray[np.uint8]:
    if image.shape[:2] == (height, width):
        return image
    from PIL import Image

    return np.asarray(Image.fromarray(image).resize((width, height), Image.Resampling.BILINEAR))
