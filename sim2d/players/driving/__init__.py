"""Driving of a player to its target: way, speed and command."""
