"""Compiled loops of the goal localiser."""
