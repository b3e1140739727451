"""Compiled loops of line points and line maps."""
