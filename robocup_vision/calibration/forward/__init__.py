"""Calibration of a forward camera's lens and mounting from pictures of a field."""
