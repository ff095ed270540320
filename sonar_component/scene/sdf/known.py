"""What of SDF is read, what changes nothing that a sonar sees, and what is left unread and therefore told once."""

from __future__ import annotations

from collections.abc import Callable

from sonar_component.scene.sdf.xml import Element

OLDEST, NEWEST = (1, 4), (1, 11)

# Lights, physics, sensors and windows: nothing that an echo comes from.
_HARMLESS = {
    "sdf": {"light"},
    "world": {
        "physics", "gui", "scene", "light", "plugin", "gravity", "magnetic_field", "atmosphere", "wind",
        "spherical_coordinates", "audio", "joint", "gripper",
    },
    "model": {
        "self_collide", "allow_auto_disable", "enable_wind", "plugin", "gripper", "kinematic", "description", "joint",
    },
    "link": {
        "inertial", "gravity", "kinematic", "self_collide", "velocity_decay", "must_be_base_link", "sensor",
        "projector", "audio_sink", "audio_source", "battery", "light", "enable_wind", "plugin",
    },
    "visual": {"cast_shadows", "laser_retro", "transparency", "meta", "plugin", "visibility_flags"},
    "collision": {"laser_retro", "max_contacts", "surface", "density", "auto_inertia_params"},
    "include": {"plugin"},
}  # fmt: skip
_READ = {
    "sdf": {"world", "model"},
    "world": {"model", "include", "frame"},
    "model": {"link", "model", "include", "frame", "joint", "pose", "static"},
    "link": {"visual", "collision", "pose", "frame"},
    "visual": {"geometry", "material", "pose"},
    "collision": {"geometry", "pose"},
    "include": {"uri", "name", "pose", "static", "placement_frame"},
}
_OWN_PREFIX = "sonar:"
_PICTURE = {  # known elements that would change what a sonar sees
    "population": "its copies are not in the picture",
    "road": "it is not in the picture",
    "actor": "it is not in the picture",
    "state": "bodies stand where their <pose> says",
    "particle_emitter": "its particles are not in the picture",
    "experimental:params": "the model is included as it is in its own file",
}


class Unread:
    """Tells each element that is not read once, where it stands first."""

    def __init__(self, warn: Callable[[Element, str], None]) -> None:
        self._warn = warn
        self._told: set[str] = set()

    def inside(self, parent: Element) -> None:
        """Look at the children of an element that is being read."""
        tag = parent.tag if parent.tag in _READ else "model"
        for child in parent.children:
            if child.tag in _READ[tag] or child.tag in _HARMLESS[tag] or child.tag.startswith(_OWN_PREFIX):
                continue
            self._tell(child, parent.tag)

    def joint(self, joint: Element) -> None:
        """Look at a joint; all but fixed ones could move in Gazebo."""
        if joint.attributes.get("type", "") != "fixed" and "joint" not in self._told:
            self._warn(joint, "does not move here: links stay where their poses say; move a body of its own instead")
            self._told.add("joint")

    def version(self, root: Element) -> None:
        """Look at the version of a file."""
        text = root.attributes.get("version", "")
        numbers = tuple(int(part) if part.isdigit() else -1 for part in text.split("."))[:2]
        if not OLDEST <= numbers <= NEWEST:
            self._warn(root, f"version must be 1.4 to 1.11, got {text!r}; read as if it were")

    def _tell(self, element: Element, parent: str) -> None:
        if element.tag in self._told:
            return
        if element.tag in _PICTURE:
            self._warn(element, f"is not read: {_PICTURE[element.tag]}")
        elif ":" in element.tag:
            return  # extensions of other programs, by SDF's own convention for custom elements
        else:
            self._warn(element, f"is not known inside <{parent}> and not read")
        self._told.add(element.tag)
