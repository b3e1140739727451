"""Chooses where to look: to locate the robot, to decide between two poses, to decide the floor ahead."""
