"""Whole pings: world, pose and settings to a Sonar sample."""
