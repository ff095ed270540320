"""``python -m sonar_component`` is the command ``sonar``."""

from sonar_component.cli.app import main

main()
