"""Localises a pinhole camera by one picture of a goal."""
