"""Compiled loops of steering, paths and gaps."""
