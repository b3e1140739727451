"""Shots at a goal, and where to stand so that a goal is covered."""
