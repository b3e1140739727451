"""Compiled loops for the floor: its colours, edges and free range, and objects on it."""
