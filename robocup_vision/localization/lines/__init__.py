"""Localises a camera by the painted field lines."""
