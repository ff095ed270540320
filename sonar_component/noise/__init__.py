"""Noise of a sonar image: beams x bins to beams x bins, given a random generator."""

from sonar_component.noise.properties import SpeckleProperties
from sonar_component.noise.speckle import Speckle

__all__ = ["Speckle", "SpeckleProperties"]
