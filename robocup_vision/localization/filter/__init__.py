"""Joins single-frame poses and odometry into pose hypotheses with probabilities."""
