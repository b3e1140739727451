"""Simulated matches: localisation, time, shots, and a side that plans."""
