"""Real-time simulator of imaging sonar."""
