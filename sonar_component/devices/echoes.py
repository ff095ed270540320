"""Echoes for a device: renders what its head orders, on a thread of its own, since a GL context belongs to one thread.

The head's thread keeps the device's clock and must never wait for a picture; it gives an order, goes on serving its
clients, and is woken when the echoes are there.
"""

from __future__ import annotations

import logging
import queue
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from sonar_component.samples import RigidBodyState, Sonar
from sonar_component.samples.scene_description import BodyPoses
from sonar_component.sonars.settings import ForwardLookingSettings, SonarSettings

if TYPE_CHECKING:
    from sonar_component.scene.world import World

_PATIENCE = 1.0  # [s], of whoever ends the thread: a task has to stop within 1.5
_UNSEEN = object()  # marks pings that nobody waits for
_ORIGIN = RigidBodyState(position=np.zeros(3), orientation=np.array([1.0, 0.0, 0.0, 0.0]))


@dataclass(eq=False)
class PingOrder:
    """One ping that a head wants.

    Attributes
    ----------
    settings : SonarSettings
        Range, bins, beams, gain, frequency in force.
    began : float
        When the pulse left [s, monotonic].
    due : float
        Before this the echoes must not leave the device [s, monotonic].
    bearing : float
        Where a scanning head looks, left positive [rad].
    note : object
        Whatever the head needs again when the echoes are there.
    """

    settings: SonarSettings
    began: float
    due: float
    bearing: float = 0.0
    note: Any = None


class Imager(Protocol):
    """Turns an order into a sonar sample; lives on one thread."""

    def ping(self, order: PingOrder, world: World, pose: RigidBodyState) -> Sonar:
        """Render one ping."""

    def release(self) -> None:
        """Give GPU memory back."""


class EchoSource:
    """The thread that renders, and the world and pose it renders from.

    Assign ``pose`` and call ``look_at`` and ``move_bodies`` from any thread; the next ping sees what they gave.

    Parameters
    ----------
    make : callable
        A GL context -> Imager.
    settings : SonarSettings
        Of a first ping that nobody sees, so that all is compiled before a client waits.
    done : callable
        Called on the rendering thread after each ping.
    """

    def __init__(
        self, make: Callable[[Any], Imager], settings: SonarSettings, done: Callable[[], None], log: logging.Logger
    ) -> None:
        self._make, self._settings, self._done, self._log = make, settings, done, log
        self.pose: RigidBodyState | None = None
        self._world: World | None = None
        self._body_poses: deque[BodyPoses] = deque(maxlen=1)
        self._orders: queue.SimpleQueue[PingOrder | None] = queue.SimpleQueue()
        self._results: queue.SimpleQueue[tuple[PingOrder, Sonar]] = queue.SimpleQueue()
        self._ready = threading.Event()
        self._failure: Exception | None = None
        self._ending = False
        self.failed = 0
        self._thread = threading.Thread(target=self._run, name="echoes", daemon=True)

    def start(self) -> None:
        """Open the GL context and compile.

        Raises
        ------
        GLUnavailableError
            If there is no OpenGL.
        """
        self._thread.start()
        self._ready.wait()
        if self._failure is not None:
            raise self._failure

    def stop(self) -> None:
        """End the thread; one that is still choosing samples is left to end by itself."""
        self._ending = True
        self._orders.put(None)
        self._thread.join(_PATIENCE)

    @property
    def world(self) -> World | None:
        """The world that pings see, if there is one."""
        return self._world

    def look_at(self, world: World) -> None:
        """See another world; it is brought to the GPU at once, not when a client waits."""
        self._world = world
        self.prepare(self._settings)

    def prepare(self, settings: SonarSettings) -> None:
        """Choose samples for settings before a client waits for their first ping."""
        self._settings = settings
        self._orders.put(PingOrder(settings, 0.0, 0.0, note=_UNSEEN))

    def move_bodies(self, poses: BodyPoses) -> None:
        """Move the bodies of the world; poses of another world are left out."""
        self._body_poses.append(poses)

    def order(self, order: PingOrder) -> None:
        """Ask for a ping."""
        self._orders.put(order)

    def take(self) -> tuple[PingOrder, Sonar] | None:
        """The next ping that is ready."""
        try:
            return self._results.get_nowait()
        except queue.Empty:
            return None

    def _run(self) -> None:
        try:
            imager = self._open()
        except Exception as error:  # handed to the thread that waits in start()
            self._failure = error
            return
        finally:
            self._ready.set()
        while (order := self._orders.get()) is not None and not self._ending:
            sample = self._render(imager, order)
            if order.note is not _UNSEEN:
                self._results.put((order, sample))
                self._done()
        imager.release()
        self._context.release()

    def _open(self) -> Imager:
        from sonar_component.gl import create_context
        from sonar_component.sonars.self_test import wall_ahead

        self._context = create_context()
        imager = self._make(self._context)
        imager.ping(PingOrder(self._settings, 0.0, 0.0), wall_ahead(self._settings.range / 2), _ORIGIN)
        return imager

    def _render(self, imager: Imager, order: PingOrder) -> Sonar:
        world, pose = self._world, self.pose
        if order.note is _UNSEEN and pose is None:
            pose = _ORIGIN
        poses = self._body_poses.popleft() if self._body_poses else None
        if world is None or pose is None:
            return nothing(order)
        try:
            if poses is not None and poses.content_hash == world.content_hash():
                world.apply_poses(poses)
            return imager.ping(order, world, pose)
        except Exception:
            if order.note is _UNSEEN:
                return nothing(order)  # the ping that a client waits for will fail too, and be told
            # A client waits for this reply: silence would look like a broken wire.
            self.failed += 1
            self._log.exception("a ping failed; its echoes are empty")
            return nothing(order)


def nothing(order: PingOrder) -> Sonar:
    """Echoes of a device that has no scene yet: none."""
    s = order.settings
    beams = s.beam_table().bearings if isinstance(s, ForwardLookingSettings) else np.array([order.bearing])
    bins = np.zeros((len(beams), s.bin_count), np.float32)
    return Sonar(
        bin_duration=s.range / s.bin_count / s.speed_of_sound, beam_width=s.beam_width, beam_height=s.beam_height,
        bearings=beams, speed_of_sound=s.speed_of_sound, bin_count=s.bin_count, beam_count=len(beams), bins=bins,
        frame=s.frame,
    )  # fmt: skip
