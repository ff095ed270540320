"""MultibeamSonarTask: a forward-looking sonar that pings the scene from each new pose.

Names are those of Rock's imaging_sonar_simulation. It renders only while somebody listens, and stamps its samples with
the time of the pose.
"""

from __future__ import annotations

from typing import Any

from sonar_component.sonars.settings import ForwardLookingSettings
from sonar_component.tasks.sonar import FIXED, OWN, SonarTask, SonarTaskProperties


class MultibeamSonarProperties(SonarTaskProperties, ForwardLookingSettings):
    """Settings of the sonar, and of the task around it."""


class MultibeamSonarTask(SonarTask):
    """Forward-looking sonar (FLS)."""

    Properties = MultibeamSonarProperties
    dynamic = frozenset(MultibeamSonarProperties.model_fields) - FIXED

    def configure_hook(self) -> bool | None:
        """Open or join the process's GL context and compile nothing yet: that depends on the scene."""
        # Compilers and mesh readers take a second to import; `sonar check` has no use for them.
        from sonar_component.sonars.forward_looking import ForwardLookingSonar

        reason = self.begin()
        if reason:
            return self.refuse(reason)
        gl = self.open_gl()
        if gl is None:
            return False
        self._gl = gl
        with gl as context:
            self._sonar = ForwardLookingSonar(context, self._settings())
        return True

    def update_hook(self) -> None:
        """Ping from the newest pose."""
        world = self.take_scene()
        pose = self.sonar_pose_cmd.read_new()
        if pose is None or world is None or not self.wanted():
            return
        with self._gl:
            sample = self._sonar.ping(world, self.own_pose(pose), self.noise_at(pose.time))
            wanted = self.properties.write_shader_image and self.shader_image.connected()
            image = self._sonar.shader_image(pose.time) if wanted else None
        self.sonar_samples.write(sample)
        if image is not None:
            self.shader_image.write(image)
        self.note("", "; ".join(self._sonar.remarks(sample)))

    def cleanup_hook(self) -> None:
        """Give the GL context back."""
        with self._gl:
            self._sonar.release()
        self._gl.release()

    def property_hook(self, name: str, value: Any) -> None:
        """Take a changed property into force from the next ping on."""
        if name not in OWN:
            self._sonar.settings = self._settings(**{name: value})

    def _settings(self, **changed: Any) -> ForwardLookingSettings:
        return ForwardLookingSettings.model_validate(self.settings_values(**changed))
