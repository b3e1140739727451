"""Markings of the field in one frame, robot frame: line segments, crossings, circles, goal posts and penalty marks."""
