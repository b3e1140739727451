"""Scenes around a goal, for pinhole cameras."""
