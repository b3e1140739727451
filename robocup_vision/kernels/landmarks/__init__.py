"""Compiled loops of the pose estimator by landmarks."""
