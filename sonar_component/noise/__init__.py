"""Noise of a sonar image: beams x bins to beams x bins, given a random generator.

Speckle is imported when it is first asked for: who only reads settings should not wait for a compiler.
"""

from typing import TYPE_CHECKING, Any

from sonar_component.noise.properties import SpeckleProperties

if TYPE_CHECKING:
    from sonar_component.noise.speckle import Speckle

__all__ = ["Speckle", "SpeckleProperties"]


def __getattr__(name: str) -> Any:
    if name == "Speckle":
        from sonar_component.noise.speckle import Speckle

        return Speckle
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
