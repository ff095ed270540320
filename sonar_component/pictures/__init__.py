"""Sonar arrays -> pictures: fans, sweeps, colours, figures. No GL, no sockets, nothing that runs by itself."""

from sonar_component.pictures.colours import COLOUR_MAPS, Tone, colour_table
from sonar_component.pictures.fan import FanMap, fan_map
from sonar_component.pictures.sweep import Sweep

__all__ = ["COLOUR_MAPS", "FanMap", "Sweep", "Tone", "colour_table", "fan_map"]
