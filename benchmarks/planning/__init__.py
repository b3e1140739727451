"""Decisions under uncertainty: where to look, which gap, how fast."""
