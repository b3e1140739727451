"""Compiled loops of the tracking of moving objects."""
