"""Photographs of real robots, which are no part of this project."""
