"""Poses from a map of landmarks."""
