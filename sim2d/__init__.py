"""Renders what robots on a field see, and plays matches on it (pymunk)."""
