"""Numbers, vectors and poses in the text of SDF elements."""

from __future__ import annotations

import math

import numpy as np

from sonar_component.scene import pose
from sonar_component.scene.sdf.xml import Element


def numbers(element: Element, allowed: tuple[int, ...], meaning: str) -> list[float]:
    """Return the numbers in an element's text; SettingsError when their count is not allowed or one is not finite."""
    words = element.text.split()
    try:
        values = [float(word) for word in words]
    except ValueError:
        raise element.error(f"must be {meaning}, got {element.text!r}") from None
    if len(values) not in allowed or not all(math.isfinite(value) for value in values):
        raise element.error(f"must be {meaning}, got {element.text!r}")
    return values


def positive(element: Element, count: int, meaning: str) -> list[float]:
    """Return `count` numbers greater than 0 [m]."""
    values = numbers(element, (count,), meaning)
    if min(values) <= 0:
        raise element.error(f"must be {meaning} greater than 0, got {element.text!r}")
    return values


def required(parent: Element, tag: str) -> Element:
    """Return the child with that tag; SettingsError at the parent when it is not there."""
    found = parent.first(tag)
    if found is None:
        raise parent.error(f"must hold <{tag}>")
    return found


def truth(element: Element | None) -> bool:
    """Return the boolean in an element's text, False where there is none."""
    if element is None:
        return False
    words = {"true": True, "1": True, "false": False, "0": False}
    if element.text.lower() not in words:
        raise element.error(f"must be true or false, got {element.text!r}")
    return words[element.text.lower()]


def read_pose(element: Element | None) -> pose.Pose:
    """Return the pose in a <pose>, the identity where there is none.

    SDF 1.9 added degrees and quaternions (x, y, z, w); before, it is always x y z roll pitch yaw [m, rad].
    """
    if element is None or not element.text:
        return np.eye(4)
    form = element.attributes.get("rotation_format", "euler_rpy")
    if form == "quat_xyzw":
        values = numbers(element, (7,), "x y z and a quaternion x y z w")
        if np.linalg.norm(values[3:]) < 1e-6:  # below what a unit quaternion can be by rounding
            raise element.error(f"must hold a quaternion of length 1, got {element.text!r}")
        return pose.from_quaternion(values[:3], (values[6], *values[3:6]))
    if form != "euler_rpy":
        raise element.error(f"rotation_format must be euler_rpy or quat_xyzw, got {form!r}")
    values = numbers(element, (6,), "x y z roll pitch yaw")
    degrees = element.attributes.get("degrees", "false") in ("true", "1")
    turn = math.pi / 180 if degrees else 1.0
    return pose.from_rpy(values[:3], [turn * angle for angle in values[3:]])
