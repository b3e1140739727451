"""Frames of cameras in match time."""
