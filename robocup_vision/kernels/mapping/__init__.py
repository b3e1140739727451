"""Compiled loops of the free-space map and of ego-motion."""
