"""Evaluates a folder of images, with figures, plots and an HTML report."""
