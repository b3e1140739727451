"""Frames of a mirror camera in match time."""
