"""Estimation of the pose on the field from the evidence of a frame."""
