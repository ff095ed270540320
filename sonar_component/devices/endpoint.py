"""What all endpoints are as tasks: ports for pose and scene in, the echoes that a client got out."""

from __future__ import annotations

import errno
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, Field, ValidationInfo

from sonar_component.devices.link import Outgoing, is_local
from sonar_component.devices.station import Station, Timing
from sonar_component.middleware.operations import operation
from sonar_component.middleware.ports import InputPort, OutputPort
from sonar_component.middleware.task import PortDriven, Task
from sonar_component.samples import RigidBodyState, Sonar
from sonar_component.samples.scene_description import MOST_BYTES, BodyPoses, SceneDescription

NO_SCENE = "NO_SCENE"
NO_POSE = "NO_POSE"

_TAKEN = (errno.EADDRINUSE, errno.EEXIST, errno.EBUSY)  # somebody else has it


def _address(text: str, info: ValidationInfo) -> str:
    if text and not is_local(text) and not info.data.get("allow_remote"):
        allowed = "at 127.0.0.1, or allow_remote must be true as well (sonar emulate: --allow-remote)"
        raise ValueError(f"must be {allowed}, got {text!r}")
    return text


# HOST:PORT, or empty for none; stands after allow_remote in its model, which decides what is allowed.
Address = Annotated[str, AfterValidator(_address)]


class EndpointProperties(BaseModel):
    """What every endpoint has beside its sonar."""

    allow_remote: bool = Field(False, description="let other computers reach the endpoint: they control the sonar")

    @classmethod
    def addresses(cls) -> tuple[str, ...]:
        """Names of the properties that are addresses; an empty one is switched off."""
        return ()

    def remote(self) -> list[str]:
        """Addresses that other computers can reach or be reached at, as ``name HOST:PORT``."""
        given = {name: getattr(self, name) for name in self.addresses()}
        return [f"{name} {text}" for name, text in given.items() if text and not is_local(text)]


class DeviceEndpoint(Task):
    """A device on its wire, fed by ports."""

    activity = PortDriven(timeout=0.5)  # so that a device that stopped is noticed also where nothing moves

    sonar_pose_cmd: InputPort[RigidBodyState] = InputPort(
        RigidBodyState, required=True, doc="Pose of the sonar in the world."
    )
    scene: InputPort[SceneDescription] = InputPort(
        SceneDescription, required=True, automatic=True, max_bytes=MOST_BYTES, doc="The world to look at."
    )
    body_poses: InputPort[BodyPoses] = InputPort(BodyPoses, automatic=True, doc="Where its moving bodies are.")
    sonar_samples: OutputPort[Sonar] = OutputPort(Sonar, queue=8, doc="What the device's client got, ping by ping.")

    _station: Station | None = None

    def open(self) -> Station:
        """Put the device on its wire; OSError that says which address cannot be had."""
        raise NotImplementedError

    def start_hook(self) -> bool | None:
        """Put the device on its wire and serve."""
        from sonar_component.gl import GLUnavailableError

        try:
            station = self.open()
            station.listen(self._sent)
            station.start()
        except (OSError, GLUnavailableError) as error:
            return self.refuse(str(error))
        self._station = station
        for place in self.properties.remote():
            self.log.warning("other computers can reach %s", place)
        self.log.info("compatible endpoint at %s", station.describe())
        return True

    def update_hook(self) -> None:
        """Hand over the newest pose and scene."""
        assert self._station is not None
        if self._station.failure is not None:
            raise RuntimeError(f"the device stopped: {self._station.failure}")
        self._take()
        echoes = self._station.echoes
        if echoes.world is None:
            self.note(NO_SCENE, "echoes are empty until a scene description comes on the port scene")
        elif echoes.pose is None:
            self.note(NO_POSE, "echoes are empty until a pose comes on the port sonar_pose_cmd")
        else:
            self.note("")

    def stop_hook(self) -> None:
        """Take the device off its wire."""
        if self._station is not None:
            self._station.stop()
            self._station = None

    def exception_hook(self) -> None:
        """Take the device off its wire."""
        self.stop_hook()

    @operation
    def timing(self) -> dict[str, float]:
        """How punctual the device was since it started: see devices.station.Timing."""
        return vars(self._station.timing() if self._station else Timing()).copy()

    def _take(self) -> None:
        from sonar_component.scene.world import World

        assert self._station is not None
        echoes = self._station.echoes
        description = self.scene.read_new()
        if description is not None:
            echoes.look_at(World.from_description(description))
        poses = self.body_poses.read_new()
        if poses is not None:
            echoes.move_bodies(poses)
        pose = self.sonar_pose_cmd.latest()
        if pose is not None:
            echoes.pose = pose

    def _sent(self, sample: Sonar, outgoing: list[Outgoing]) -> None:
        if self.sonar_samples.connected():
            self.sonar_samples.write(sample)


def opened(name: str, make: Any, address: Any) -> Any:
    """``make(address)``, with an OSError that names the property, the address and what to do."""
    try:
        return make(address)
    except OSError as error:
        todo = "free it or choose another" if error.errno in _TAKEN else "choose another"
        raise OSError(f"{name}: {address}: {error.strerror or error}; {todo}") from None
