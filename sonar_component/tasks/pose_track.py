"""Poses as they come from outside, checked, and the pose at any time between them.

Decision: a pose that contradicts the one before is refused, but two in a row that agree with each other are believed.
A log that is replayed from its start, or a vehicle that is put elsewhere, then costs one sample; refusing everything
that does not fit, for ever, would cost a restart.
"""

from __future__ import annotations

from collections import deque

from sonar_component.samples import RigidBodyState
from sonar_component.samples.motion import interpolate, moved_between

_KEPT = 512  # [-], poses: ten seconds at 50 Hz, more than any gap that is bridged


class PoseTrack:
    """The last poses, in order of time.

    Parameters
    ----------
    longest_gap : float
        Poses further apart in time are not connected [s].
    most_speed, most_turn : float
        A vehicle that moves [m/s] or turns [rad/s] faster than this from one pose to the next is not believed.
    """

    def __init__(self, longest_gap: float, most_speed: float = float("inf"), most_turn: float = float("inf")) -> None:
        self.longest_gap, self.most_speed, self.most_turn = longest_gap, most_speed, most_turn
        self._poses: deque[RigidBodyState] = deque(maxlen=_KEPT)
        self._doubted: RigidBodyState | None = None

    @property
    def newest(self) -> RigidBodyState | None:
        """The last pose that was believed."""
        return self._poses[-1] if self._poses else None

    def clear(self) -> None:
        """Forget everything."""
        self._poses.clear()
        self._doubted = None

    def add(self, pose: RigidBodyState) -> bool:
        """Take a pose; False where it is the last one again.

        Raises
        ------
        ValueError
            If it does not follow from the poses before; says why.
        """
        newest = self.newest
        if newest is not None and pose.time == newest.time:
            return False
        reason = self._against(newest, pose)
        if reason:
            doubted, self._doubted = self._doubted, pose
            if doubted is None or self._against(doubted, pose):
                raise ValueError(reason)
            self._poses.clear()
            self._poses.append(doubted)
        elif newest is not None and self._gap(newest, pose) > self.longest_gap:
            self._poses.clear()
        self._doubted = None
        self._poses.append(pose)
        return True

    def begins(self) -> int:
        """Time of the oldest pose that is connected with the newest [us]; 0 if there is none."""
        return self._poses[0].time if self._poses else 0

    def at(self, time: int) -> RigidBodyState:
        """The pose at a time [us], between two poses or beyond the newest; a lone pose stands still.

        Raises
        ------
        ValueError
            If no pose came yet, or the time lies before the oldest.
        """
        if not self._poses:
            raise ValueError("no pose came yet")
        if len(self._poses) == 1:
            return self._poses[0]
        if time < self._poses[0].time:
            raise ValueError(f"no pose is known at {time} us, the oldest is of {self._poses[0].time} us")
        later = len(self._poses) - 1
        while later > 1 and self._poses[later - 1].time >= time:
            later -= 1
        return interpolate(self._poses[later - 1], self._poses[later], time)

    def _gap(self, earlier: RigidBodyState, later: RigidBodyState) -> float:
        return (later.time - earlier.time) * 1e-6

    def _against(self, before: RigidBodyState | None, pose: RigidBodyState) -> str:
        """What speaks against `pose` as the successor of another, or the empty string."""
        if before is None:
            return ""
        seconds = self._gap(before, pose)
        if seconds <= 0:
            return f"time runs backwards: a pose of {pose.time} us after one of {before.time} us"
        distance, angle = moved_between(before.transform(), pose.transform())
        if distance > self.most_speed * seconds:
            allowed = f"allowed {self.most_speed:g} m/s"
            return f"jumps {distance:.3g} m in {seconds:.3g} s, {distance / seconds:.3g} m/s, {allowed}"
        if angle > self.most_turn * seconds:
            allowed = f"allowed {self.most_turn:.3g} rad/s"
            return f"turns {angle:.3g} rad in {seconds:.3g} s, {angle / seconds:.3g} rad/s, {allowed}"
        return ""
