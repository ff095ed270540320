"""GLSL sources, as package data."""
