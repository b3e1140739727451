"""Compiled loops that find a goal's posts and bar by their paint."""
