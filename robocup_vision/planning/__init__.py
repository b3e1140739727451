"""Planning: where to look, which gap to take, how fast to go; from estimates alone."""
