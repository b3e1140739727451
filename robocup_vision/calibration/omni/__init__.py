"""Calibration of a mirror camera from unlabelled images of the field."""
