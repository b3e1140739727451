"""Compiled loops that fit the outline of the floor to a field's walls, and the camera with it."""
