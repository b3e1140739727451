"""Recordings: what they cost the loop, and whether they come back."""
