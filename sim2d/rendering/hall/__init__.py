"""A hall with textured walls, for landmark maps."""
