"""Compiled loops that follow a pinhole camera by the edges that the field file lets it expect."""
