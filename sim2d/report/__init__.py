"""Figures of a match, match.json, film and report."""
