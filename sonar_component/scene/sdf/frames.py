"""Names and poses within one <model> or <world>: the frame semantics of SDF 1.7, which hold for older files too.

Each scope has its own frame and frames by name: links, frames, joints, nested models. A pose is relative to the frame
that it names, or to a default that depends on its owner; `a::b` looks for b inside the nested model a.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from sonar_component.scene import pose
from sonar_component.scene.sdf.numbers import read_pose
from sonar_component.scene.sdf.xml import Element


@dataclass
class _Frame:
    element: Element
    X_RF: pose.Pose
    relative_to: str


@dataclass
class Scope:
    """Frames of one model or world; poses come out relative to its own frame.

    Attributes
    ----------
    own : what its own frame is called inside.
    frames : the frames that it names.
    nested : scopes of models inside, by their names, which are frames too.
    merged : scopes whose frames count as this one's (`<include merge="true">`).
    """

    own: tuple[str, ...] = ("", "__model__")
    frames: dict[str, _Frame] = field(default_factory=dict)
    nested: dict[str, Scope] = field(default_factory=dict)
    merged: list[Scope] = field(default_factory=list)
    _known: dict[str, pose.Pose] = field(default_factory=dict)

    def add(self, owner: Element, name: str, default: str = "") -> None:
        """Name a frame by the <pose> of its owner (link, frame, joint), relative to `default` if it says nothing."""
        at = owner.first("pose")
        relative_to = relative_name(at) or default
        self.frames[name] = _Frame(owner, read_pose(at), relative_to)

    def put(self, owner: Element, name: str, X_RF: pose.Pose, relative_to: str) -> None:
        """Name a frame with a given pose."""
        self.frames[name] = _Frame(owner, X_RF, relative_to)

    def resolve(self, name: str, asker: Element) -> pose.Pose:
        """Pose of a frame in this scope.

        Raises
        ------
        SettingsError
            When no frame has that name, or frames are relative to each other in a circle.
        """
        return self._resolve(name, asker, ())

    def _resolve(self, name: str, asker: Element, trail: tuple[str, ...]) -> pose.Pose:
        if name in self.own:
            return np.eye(4)
        if name in self._known:
            return self._known[name]
        if name in trail:
            raise asker.error(f"frames are relative to each other in a circle: {' -> '.join((*trail, name))}")
        frame = self.frames.get(name)
        if frame is not None:
            X = self._resolve(frame.relative_to, frame.element, (*trail, name)) @ frame.X_RF
        else:
            X = self._inside(name, asker, trail)
        self._known[name] = X
        return X

    def _inside(self, name: str, asker: Element, trail: tuple[str, ...]) -> pose.Pose:
        head, _, rest = name.partition("::")
        if rest and head in self.nested:
            return self._resolve(head, asker, (*trail, name)) @ self.nested[head].resolve(rest, asker)
        for scope in self.merged:
            if name in scope.frames:
                return self._resolve(_merged_name(scope), asker, (*trail, name)) @ scope.resolve(name, asker)
        known = ", ".join(sorted(self.frames)) or "none"
        raise asker.error(f"no frame {name!r} here; frames: {known}")

    def merge(self, owner: Element, scope: Scope, X_RF: pose.Pose, relative_to: str) -> str:
        """Take in the frames of an included model; returns the name of its own frame here."""
        self.merged.append(scope)
        self.put(owner, _merged_name(scope), X_RF, relative_to)
        return _merged_name(scope)


def relative_name(at: Element | None) -> str:
    """Return what a <pose> is relative to; SDF 1.5 and 1.6 called the attribute `frame`."""
    if at is None:
        return ""
    return at.attributes.get("relative_to") or at.attributes.get("frame") or ""


def _merged_name(scope: Scope) -> str:
    return f"__merged_{id(scope)}__"
