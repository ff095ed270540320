"""ScanningSonarTask: a mechanically scanning sonar that pings at its own pace, whatever the pace of the poses.

Each ping is computed for its own time, from the pose of the vehicle at that time between two poses. So a ping waits
for the first pose after it; while no pose comes, pings go on for `max_extrapolation` along the last known motion, and
then stop. The original simulator pings once per pose instead, whatever a real head would have managed.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field, model_validator

from sonar_component.middleware.ports import OutputPort
from sonar_component.middleware.task import INVALID_INPUT, STALE_INPUT, PortDriven
from sonar_component.samples import RigidBodyState, Sonar
from sonar_component.settings.quantity import Duration
from sonar_component.sonars.scan import Scan
from sonar_component.sonars.scanning_settings import ScanningSettings
from sonar_component.tasks.micron_config import MicronConfig, with_config
from sonar_component.tasks.pose_track import PoseTrack
from sonar_component.tasks.sonar import FIXED, OWN, SonarTask, SonarTaskProperties

if TYPE_CHECKING:
    from sonar_component.scene.world import World

EXTRAPOLATING = "EXTRAPOLATING"
_OWN = OWN | {"config", "max_extrapolation", "max_pose_age", "scan_period"}
_AT_ONCE = 64  # [-], pings in one cycle; the task must come by its commands in between


class ScanningSonarProperties(SonarTaskProperties, ScanningSettings):
    """Settings of the sonar, and of the task around it."""

    max_extrapolation: Annotated[Duration, Field(ge=0, le=10)] = Field(
        0.1, description="how far pings go beyond the last pose while no other comes"
    )
    max_pose_age: Annotated[Duration, Field(gt=0, le=3600)] = Field(
        1.0, description="an older pose is not used, and a longer gap between two is not bridged"
    )
    scan_period: Annotated[Duration, Field(gt=0)] = Field(0.5, description="between two writes of the full scan")
    config: MicronConfig | None = Field(None, description="all of it in the words of Rock's driver of the Micron")

    @model_validator(mode="before")
    @classmethod
    def _words_of_the_driver(cls, values: Any) -> Any:
        return with_config(values)


class ScanningSonarTask(SonarTask):
    """Mechanically scanning imaging sonar (MSIS)."""

    Properties = ScanningSonarProperties
    dynamic = frozenset(ScanningSonarProperties.model_fields) - FIXED - {"config"}
    activity = PortDriven(("sonar_pose_cmd",), timeout=0.1)

    scan_samples: OutputPort[Sonar] = OutputPort(
        Sonar, queue=2, doc="All beams of the last scan with the time of each; latched."
    )

    def configure_hook(self) -> bool | None:
        """Open or join the process's GL context and compile nothing yet: that depends on the scene."""
        # Compilers and mesh readers take a second to import; `sonar check` has no use for them.
        from sonar_component.sonars.scanning import ScanningSonar

        reason = self.begin()
        if reason:
            return self.refuse(reason)
        gl = self.open_gl()
        if gl is None:
            return False
        self._gl = gl
        with gl as context:
            self._sonar = ScanningSonar(context, self._settings())
        self._new_scan()
        return True

    def start_hook(self) -> bool | None:
        """The first pose says when the first ping is."""
        self._track = PoseTrack(self.properties.max_pose_age)
        self._next = self._heard = self._scan_written = 0
        self._remarks: list[str] = []
        return True

    def update_hook(self) -> None:
        """All pings that are due."""
        world = self.take_scene()
        if not self._take_poses():
            return
        if world is None:
            self._next = 0  # pings begin when there is something to see
            return
        horizon = self._horizon()
        for _ in range(_AT_ONCE):
            if self._next > horizon:
                break
            self._ping(world, self._next)
            self._next += round(self.properties.ping_period * 1e6)
        else:
            self._catch_up(horizon)

    def cleanup_hook(self) -> None:
        """Give the GL context back."""
        with self._gl:
            self._sonar.release()
        self._gl.release()

    def property_hook(self, name: str, value: Any) -> None:
        """Take a changed property into force from the next ping on."""
        if name == "max_pose_age":
            self._track.longest_gap = value
        if name in _OWN:
            return
        places = self._sonar.head.bearings().tolist()
        self._sonar.settings = self._settings(**{name: value})
        if self._sonar.head.bearings().tolist() != places:
            self._new_scan()

    def _settings(self, **changed: Any) -> ScanningSettings:
        values = {name: value for name, value in self.settings_values(**changed).items() if name not in _OWN}
        return ScanningSettings.model_validate(values)

    def _new_scan(self) -> None:
        self._scan = Scan(self._sonar.head.bearings(), self._sonar.settings.motor_step)

    def _take_poses(self) -> bool:
        """Read what came; False where there is nothing to go on with, and the state says why."""
        port = self.sonar_pose_cmd
        now = self.now()
        while (pose := port.read_new()) is not None:
            self._heard = now
            try:
                self._track.add(pose)
            except ValueError as error:
                self.error(INVALID_INPUT, f"{port.full_name}: {error}", port)
                return False
        newest = self._track.newest
        if newest is None:
            return False
        age = (now - newest.time) * 1e-6
        if age > self.properties.max_pose_age:
            allowed = f"allowed {self.properties.max_pose_age:g} s"
            self.error(STALE_INPUT, f"{port.full_name}: the last pose is {age:.2f} s old, {allowed}", port)
            return False
        self._resume(newest)
        return True

    def _resume(self, newest: RigidBodyState) -> None:
        """Begin with the first pose, and again after a gap, in which the head has turned on."""
        if not self._next:
            self._next = self._track.begins()
        elif self._next < self._track.begins():
            missed = (self._track.begins() - self._next) * 1e-6
            self.log.warning("%.2f s without poses: the pings of that time are left out", missed)
            self._skip(missed)
        elif self._next > newest.time + 1e6 * (self.properties.max_extrapolation + self.properties.ping_period):
            self._next = newest.time  # time was set back

    def _skip(self, seconds: float) -> None:
        """Leave out the pings of some time; none of them begins before it is over."""
        pings = math.ceil(seconds / self.properties.ping_period)
        self._next += round(pings * self.properties.ping_period * 1e6)
        self._sonar.head.skip(pings)

    def _horizon(self) -> int:
        """Up to when pings can be computed [us]."""
        newest = self._track.newest
        assert newest is not None
        reach: int = round(1e6 * self.properties.max_extrapolation)
        if self.now() - self._heard <= reach:
            self.note("", "; ".join(self._remarks))
            return newest.time
        if self._next <= newest.time + reach:
            self.note(EXTRAPOLATING, f"no pose for {reach * 1e-6:g} s: pings go on along the last motion, no further")
        return newest.time + reach

    def _catch_up(self, horizon: int) -> None:
        behind = (horizon - self._next) * 1e-6
        if behind > self.properties.max_pose_age:
            self.log.warning("%.1f s behind: the pings of that time are left out", behind)
            self._skip(behind)

    def _ping(self, world: World, time: int) -> None:
        head = self._sonar.head
        if self.wanted() or self.scan_samples.connected():
            vehicle = self._track.at(time)
            if vehicle.time != time:  # a lone pose: the vehicle is where it was
                vehicle = _at_time(vehicle, time)
            with self._gl:
                sample = self._sonar.ping(world, self.own_pose(vehicle), self.noise_at(time))
                wanted = self.properties.write_shader_image and self.shader_image.connected()
                image = self._sonar.shader_image(time) if wanted else None
            self.sonar_samples.write(sample)
            self._scan.add(head.place, sample)
            if image is not None:
                self.shader_image.write(image)
            self._write_scan(time, head.advance())
        else:
            head.advance()

    def _write_scan(self, time: int, ended: bool) -> None:
        """The full scan at its end, for those who come later, and now and then for those who look."""
        due = (time - self._scan_written) * 1e-6 >= self.properties.scan_period
        if ended or (due and self.scan_samples.connected()):
            self._scan_written = time
            whole = self._scan.sample()
            self.scan_samples.write(whole)
            if ended:
                self._remarks = self._sonar.remarks(whole)


def _at_time(pose: RigidBodyState, time: int) -> RigidBodyState:
    return RigidBodyState(
        time=time,
        sourceFrame=pose.sourceFrame,
        targetFrame=pose.targetFrame,
        position=pose.position,
        orientation=pose.orientation,
        velocity=pose.velocity,
        angular_velocity=pose.angular_velocity,
    )
