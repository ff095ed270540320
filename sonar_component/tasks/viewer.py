"""ViewerTask: shows the images of any number of sonars on a live page, and keeps pictures of them if asked.

The task's thread only takes samples from its ports and puts them on a board; page, 3-D world and pictures are drawn by
other threads from there, always from the newest image. So the connections to this task empty at once, whatever a
browser does. An image that cannot be drawn is counted and said, and does not put the task into an error state: it shows
several sonars, and one that is broken must not hide the others.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field, model_validator

from sonar_component.middleware.operations import operation
from sonar_component.middleware.policy import Received
from sonar_component.middleware.ports import Connection, InputPort, invalid_reason
from sonar_component.middleware.task import NoProperties, PortDriven, Task
from sonar_component.samples import Frame, Sonar
from sonar_component.samples.scene_description import MOST_BYTES, BodyPoses, SceneDescription
from sonar_component.settings.quantity import Duration
from sonar_component.tasks.page import LOOPBACK

if TYPE_CHECKING:
    from sonar_component.scene.world import World

PORT_IN_USE = "PORT_IN_USE"

_RETRY = 1.0  # [s], between two tries to get a port that somebody else has


class ViewerProperties(NoProperties):
    """What can be set."""

    address: str = Field("127.0.0.1", description="address that the page is served on")
    port: int = Field(8080, ge=0, le=65535, description="TCP port of the page; 0: one that is free")
    allow_remote: bool = Field(False, description="serve other computers too: they see and set everything")
    snapshot_dir: str = Field("", description="folder for PNG pictures of what was seen; empty: none")
    snapshot_period: Duration = Field(5.0, gt=0, description="between two pictures")
    colour_map: Literal["copper", "gray", "viridis"] = Field("copper", description="of the pictures")

    @model_validator(mode="after")
    def _remote_is_meant(self) -> ViewerProperties:
        if self.address not in LOOPBACK and not self.allow_remote:
            allowed = ", ".join(LOOPBACK)
            message = f"address must be {allowed}, or allow_remote must be true as well, got {self.address!r}"
            raise ValueError(message)
        return self


class ViewerTask(Task):
    """Live page at http://127.0.0.1:8080."""

    Properties = ViewerProperties
    dynamic = frozenset({"colour_map"})
    activity = PortDriven(timeout=0.5)

    sonar_samples: InputPort[Sonar] = InputPort(Sonar, doc="Images of any number of sonars.")
    scene: InputPort[SceneDescription] = InputPort(
        SceneDescription, automatic=True, max_bytes=MOST_BYTES, doc="The world, to be shown around the sonars."
    )
    body_poses: InputPort[BodyPoses] = InputPort(BodyPoses, automatic=True, doc="Where its moving bodies are.")
    camera_samples: InputPort[Frame] = InputPort(Frame, doc="Pictures of an underwater camera.")

    def configure_hook(self) -> bool | None:
        """See whether the page can be built at all."""
        from sonar_component.tasks.page.board import Board  # worlds and pictures: `sonar check` has no use for them

        self.board = Board()
        self._scene: World | None = None
        self._server: Any = None
        self._snapshots: Any = None
        self._tried = 0.0
        try:
            import websockets  # noqa: F401
        except ImportError:
            return self.refuse('the page needs the viewer extra: pip install "sonar-component[viewer]"')
        return True

    def start_hook(self) -> bool | None:
        """Open the page and the folder for pictures."""
        if self.properties.snapshot_dir:
            from sonar_component.tasks.page.snapshots import Snapshots

            folder = Path(self.properties.snapshot_dir).expanduser()
            try:
                self._snapshots = Snapshots(
                    self.board, folder, self.properties.snapshot_period, self.properties.colour_map, self.log
                )
            except OSError as error:
                return self.refuse(f"snapshot_dir: {folder} cannot be written: {error.strerror}")
        self._open_page()
        return True

    def update_hook(self) -> None:
        """Put what came on the board."""
        self._take_all()

    def error_hook(self) -> None:
        """Go on taking images; ask again for a port that was in use."""
        if self._server is None:
            self._take_all()
            self._open_page()
        else:
            super().error_hook()

    def stop_hook(self) -> None:
        """Close the page, write the last pictures."""
        if self._snapshots is not None:
            self._snapshots.finish()
        if self._server is not None:
            self._server.stop()
        if self._snapshots is not None:
            self._snapshots.wait()
        self._server = self._snapshots = None

    @operation
    def page(self) -> str:
        """Where the page is."""
        if self._server is None:
            raise ValueError(self.lifecycle.reason or "the page is not open")
        host = f"[{self.properties.address}]" if ":" in self.properties.address else self.properties.address
        return f"http://{host}:{self._server.port}"

    def _open_page(self) -> None:
        import time

        from sonar_component.tasks.page.files import saved_file
        from sonar_component.tasks.page.graph import Graph
        from sonar_component.tasks.page.server import PageServer
        from sonar_component.tasks.page.world import World

        if time.monotonic() - self._tried < _RETRY:
            return
        self._tried = time.monotonic()
        address, port = self.properties.address, self.properties.port
        server = PageServer(self.board, Graph(self), self.now, saved_file, World(self.board, self.log), self.log)
        try:
            server.start(address, port)
        except OSError as error:
            reason = f"http://{address}:{port}: {error.strerror or error}; free it or set {self.name}.port"
            self.error(PORT_IN_USE, reason)
            return
        self._server = server
        self.log.info("page at http://%s:%d", address, server.port)
        if self.lifecycle.substate == PORT_IN_USE:
            self.recover()

    def _take_all(self) -> None:
        self._take_scene()
        for connection in self.sonar_samples.connections:
            newest = self._take(connection)
            channel = self.board.channels.get(connection.source)
            if channel is not None:
                account = connection.mailbox.account
                channel.dropped, channel.lost = account.dropped + account.replaced, account.lost
            if newest is not None:
                self.sonar_samples.last = newest
        for connection in self.camera_samples.connections:
            while (received := connection.mailbox.take()) is not None:
                if not invalid_reason(received.sample):
                    self.board.put_camera(received.sample)

    def _take_scene(self) -> None:
        from sonar_component.scene.world import World

        description, poses = self.scene.read_new(), self.body_poses.read_new()
        if description is not None:
            self._scene = World.from_description(description)
        if self._scene is None:
            return
        if poses is not None and poses.content_hash == self._scene.content_hash():
            self._scene.apply_poses(poses)
        if self._server is not None:
            self._server.world.show(self._scene)

    def _take(self, connection: Connection) -> Received | None:
        """All that waits in one connection: every beam of a scanning head counts, so none is passed over."""
        newest = None
        while (received := connection.mailbox.take()) is not None:
            newest = received
            reason = invalid_reason(received.sample)
            if not reason:
                odd = self.board.put(connection.source, received.sample)
            else:
                odd = reason if self.board.refuse(connection.source, reason) else ""
            if odd:
                self.log.warning("%s: %s", connection.source, odd)
        return newest
