"""Compiled loops that read the floor: colours, edges, free range, ball."""
