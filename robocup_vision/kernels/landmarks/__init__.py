"""Compiled loops of the landmark localiser."""
