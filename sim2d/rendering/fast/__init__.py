"""Fast rendering of frames for matches."""
