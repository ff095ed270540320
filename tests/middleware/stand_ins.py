"""Stand-in tasks for graphs of real processes: installed for the tests through an entry-point folder of their own."""

from __future__ import annotations

import os
import signal
import sys
import time

import numpy as np
from pydantic import Field

from sonar_component.middleware import InputPort, NoProperties, OutputPort, Periodic, PortDriven, Task, operation
from sonar_component.samples import RigidBodyState, Sonar


class SourceProperties(NoProperties):
    beams: int = Field(4, ge=1)
    bins: int = Field(8, ge=1)
    gain: float = Field(0.5, ge=0, le=1)


class SourceTask(Task):
    """Writes numbered frames; renders nothing, but counts what it would render."""

    Properties = SourceProperties
    dynamic = frozenset({"gain", "bins"})
    activity = Periodic(0.02)
    sonar_samples: OutputPort[Sonar] = OutputPort(Sonar, queue=8)
    pose_samples: OutputPort[RigidBodyState] = OutputPort(RigidBodyState)
    rendered = 0

    def update_hook(self) -> None:
        now = self.now()
        self.pose_samples.write(RigidBodyState(time=now, position=np.zeros(3), orientation=np.array([1.0, 0, 0, 0])))
        if self.sonar_samples.connected():
            self.rendered += 1
            self.sonar_samples.write(frame(now, self.properties.beams, self.properties.bins, self.rendered))

    @operation
    def rendered_count(self) -> int:
        """How many frames were computed."""
        return self.rendered

    @operation
    def hang(self, seconds: float) -> None:
        """Hold the task's thread."""
        time.sleep(seconds)

    @operation
    def die(self) -> None:
        """Kill the process."""
        os.kill(os.getpid(), signal.SIGKILL)


def frame(now: int, beams: int, bins: int, value: float) -> Sonar:
    """A frame whose every bin holds `value`."""
    return Sonar(
        time=now, bin_duration=1e-4, beam_width=1.0, beam_height=0.3, bearings=np.linspace(0.5, -0.5, beams),
        bin_count=bins, beam_count=beams, bins=np.full((beams, bins), value, np.float32),
    )  # fmt: skip


class PoseToSonarTask(Task):
    """One frame for each pose: what a sonar looks like from outside."""

    Properties = SourceProperties
    activity = PortDriven(("sonar_pose_cmd",))
    sonar_pose_cmd: InputPort[RigidBodyState] = InputPort(RigidBodyState, required=True)
    sonar_samples: OutputPort[Sonar] = OutputPort(Sonar, queue=8)

    def update_hook(self) -> None:
        pose = self.sonar_pose_cmd.read_new()
        if pose is not None and self.sonar_samples.connected():
            self.sonar_samples.write(frame(pose.time, self.properties.beams, self.properties.bins, pose.position[0]))


class StuckTask(Task):
    """Hangs in its third cycle."""

    activity = Periodic(0.02)

    def update_hook(self) -> None:
        if self.counters.cycles >= 3:
            time.sleep(3600)


class RaisingTask(Task):
    """Raises in its third cycle."""

    activity = Periodic(0.02)

    def update_hook(self) -> None:
        if self.counters.cycles >= 3:
            raise ZeroDivisionError("third cycle")


class NoisySonarTask(Task):
    """A frame of noise for each pose, drawn for the pose's time: who listens changes nothing."""

    activity = PortDriven(("sonar_pose_cmd",))
    sonar_pose_cmd: InputPort[RigidBodyState] = InputPort(RigidBodyState, required=True)
    sonar_samples: OutputPort[Sonar] = OutputPort(Sonar, queue=1000)

    def update_hook(self) -> None:
        while (pose := self.sonar_pose_cmd.read_new()) is not None:
            sonar = frame(pose.time, 16, 20, 0.0)
            sonar.bins = np.random.default_rng(pose.time).random((16, 20), np.float32)
            self.sonar_samples.write(sonar)


class NumbersTask(Task):
    """Remembers the first coordinate of each pose."""

    activity = PortDriven(("poses",))
    poses: InputPort[RigidBodyState] = InputPort(RigidBodyState)

    def configure_hook(self) -> None:
        self.seen: list[float] = []

    def update_hook(self) -> None:
        while (pose := self.poses.read_new()) is not None:
            self.seen.append(float(pose.position[0]))

    @operation
    def numbers(self) -> list[float]:
        """What was read."""
        return self.seen


class WorkProperties(NoProperties):
    configuring: float = 0.0
    stopping: float = 0.0
    sleeping: bool = False


class WorkTask(Task):
    """Works, or sleeps, for some seconds in its hooks: as one that compiles, or one that hangs."""

    Properties = WorkProperties
    activity = Periodic(0.02)

    def _work(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if self.properties.sleeping:
                time.sleep(0.1)

    def configure_hook(self) -> None:
        sys.stdout.write(f"configuring for {self.properties.configuring} s\n")
        sys.stdout.flush()
        self._work(self.properties.configuring)

    def stop_hook(self) -> None:
        self._work(self.properties.stopping)
