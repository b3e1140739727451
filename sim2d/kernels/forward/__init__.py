"""Compiled loops that draw a forward camera's match frame."""
