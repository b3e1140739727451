"""Calibration of cameras and colours from images of the field, without a chessboard or measured points."""
