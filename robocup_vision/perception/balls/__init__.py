"""Balls in one frame: where one may be, its size there, and the likelihood ratio of each candidate."""
