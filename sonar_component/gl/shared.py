"""One GL context for all tasks of a process that draw on the same device; they take turns.

So two sonars of one process keep one world in GPU memory. A context is current on one thread at a time, and handing it
over costs 4 microseconds. Contexts that share objects lost: moderngl's EGL makes none without a window, and would
refuse another context's buffers in a vertex array. One render thread for all lost too: every ping would wait for two
threads to wake. Sonars that must not wait for each other belong into processes of their own.

The table of open contexts is the one thing of this package that belongs to the process and not to an argument: tasks of
one process know nothing of each other.
"""

from __future__ import annotations

import threading
from types import TracebackType

from sonar_component.gl.context import Context, create_context

_open: dict[tuple[int | None, str | None], SharedContext] = {}
_table = threading.Lock()


class SharedContext:
    """A context for one user at a time: ``with shared as context: ...`` from any thread.

    Make it with ``share_context``, and give it back with ``release`` when its users have released what they made.
    Between turns no context is current on a thread: EGL through moderngl does not bring an earlier one back.
    """

    def __init__(self, key: tuple[int | None, str | None]) -> None:
        self._key, self._users = key, 0
        self._turn, self._depth = threading.RLock(), 0
        self._context = create_context(*key)
        _put_down(self._context)

    def __enter__(self) -> Context:
        self._turn.acquire()
        if self._depth == 0:
            self._context.__enter__()  # type: ignore[no-untyped-call]  # moderngl has no types for these two
        self._depth += 1
        return self._context

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._depth -= 1
        if self._depth == 0:
            _put_down(self._context)
        self._turn.release()

    def release(self) -> None:
        """Use it no longer; the last to do so closes it."""
        with _table:
            self._users -= 1
            if self._users == 0:
                del _open[self._key]
                with self._turn:
                    self._context.release()


def share_context(device: int | None = None, driver: str | None = None) -> SharedContext:
    """The process's context on a device, opened if it is not; arguments and errors are ``create_context``'s."""
    key = (device, driver)
    with _table:
        if key not in _open:
            _open[key] = SharedContext(key)
        _open[key]._users += 1
        return _open[key]


def _put_down(context: Context) -> None:
    """Leave the context current on no thread, so that another one may take it."""
    context.__exit__(None, None, None)  # type: ignore[no-untyped-call]
