"""The world that a sonar looks at: bodies with poses, meshes, materials, and the readers that make them from files."""

from sonar_component.scene.body import Body, Part
from sonar_component.scene.loading import load_world
from sonar_component.scene.material import Material
from sonar_component.scene.mesh import Mesh
from sonar_component.scene.world import World

__all__ = ["Body", "Material", "Mesh", "Part", "World", "load_world"]
