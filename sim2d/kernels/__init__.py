"""Compiled loops of the simulator's match camera, one file a concept; the tests hold each against plain NumPy."""
