"""Filter that fuses single-frame poses and odometry to pose hypotheses with probabilities."""
