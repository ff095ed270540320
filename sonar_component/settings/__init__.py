"""From YAML to validated settings: strict loader, quantities with units, errors that name file, line and key."""

from sonar_component.settings.errors import SettingsError, SettingsErrors
from sonar_component.settings.loader import Document, load_yaml, overlay
from sonar_component.settings.paths import find_file
from sonar_component.settings.quantity import parse
from sonar_component.settings.validation import validate

__all__ = ["Document", "SettingsError", "SettingsErrors", "find_file", "load_yaml", "overlay", "parse", "validate"]
