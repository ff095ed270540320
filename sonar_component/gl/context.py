"""A headless OpenGL context through EGL: no display, no window; Mesa's llvmpipe and hardware drivers alike."""

from __future__ import annotations

import os
from typing import Any

import moderngl

Context = moderngl.Context  # so that rooms above can name it without importing moderngl

_REQUIRED_VERSION = 430  # compute shaders and storage buffers
_SOFTWARE = ("llvmpipe", "softpipe", "swrast", "SwiftShader")


class GLUnavailableError(RuntimeError):
    """No usable OpenGL; the message says what is missing and how to get it."""


def create_context(device: int | None = None, driver: str | None = None) -> moderngl.Context:
    """Open a context of its own on this thread.

    Parameters
    ----------
    device : int, optional
        EGL device index; by default EGL's own first choice.
    driver : str, optional
        Mesa's ``GALLIUM_DRIVER``, such as ``llvmpipe``; takes effect for the first context of a process.

    Raises
    ------
    GLUnavailableError
        If there is no EGL, no such device, or no OpenGL 4.3.
    """
    if driver is not None:
        os.environ["GALLIUM_DRIVER"] = driver
    options: dict[str, Any] = {"standalone": True, "backend": "egl", "require": _REQUIRED_VERSION}
    if device is not None:
        options["device_index"] = device
    try:
        return moderngl.create_context(**options)
    except Exception as error:
        # glcontext raises bare Exceptions of many texts; all of them mean that there is no context to be had.
        words = " ".join(str(error).split())
        if device is not None and "device index" in words:
            raise GLUnavailableError(f"no EGL device {device}: {words}; without a number the first is taken") from None
        raise GLUnavailableError(
            f"no headless OpenGL 4.3 through EGL ({words}); "
            "on Debian or Ubuntu: sudo apt-get install libegl1 libgl1-mesa-dri libgl1"
        ) from None


def is_software(context: moderngl.Context) -> bool:
    """Whether the context draws on the CPU."""
    return any(name in context.info["GL_RENDERER"] for name in _SOFTWARE)
