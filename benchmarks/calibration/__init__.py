"""Cameras and colours calibrated by images."""
