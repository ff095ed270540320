"""The command ``sonar``, one file per group of verbs."""
