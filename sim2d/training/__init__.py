"""Renderings that the ball classifier is trained on, and its training (extra `train`)."""
