"""A copy of a world that lives in another task, kept by its descriptions and poses as they come."""

from __future__ import annotations

from sonar_component.samples.scene_description import BodyPoses, SceneDescription
from sonar_component.scene.world import World


class Replica:
    """Follows a world; poses that come before the description they belong to wait for it.

    The two travel on ports of their own, and a description takes longer on its way.

    Attributes
    ----------
    world : None until a description has come.
    """

    def __init__(self) -> None:
        self.world: World | None = None
        self._waiting: BodyPoses | None = None

    def take(self, description: SceneDescription | None, poses: BodyPoses | None) -> World | None:
        """Take what came, if anything, and return the world as it is now.

        Raises
        ------
        ValueError
            When a description is damaged; the world before it stays.
        """
        if description is not None:
            self.world = World.from_description(description)
        self._waiting = poses or self._waiting
        if self.world is not None and self._waiting is not None:
            if self._waiting.content_hash == self.world.content_hash():
                self.world.apply_poses(self._waiting)
                self._waiting = None
        return self.world
