"""Robots that drive by what their camera shows."""
