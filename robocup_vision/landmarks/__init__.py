"""Localisation by landmarks on the surroundings: a map from a run with three cameras, and poses from one camera."""
