"""Compiled loops that place a camera by a goal and by the field lines around it."""
