"""Localisation of a camera by the painted field lines."""
