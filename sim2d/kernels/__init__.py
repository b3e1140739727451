"""Compiled loops of the simulator; each is held against a plain NumPy twin by the tests."""
