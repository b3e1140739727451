"""Plays matches, courses and tournaments."""
