"""The simulator's commands of `robocup-vision`, found by entry point.

Each raises RobocupVisionError for every problem that the user can solve.
"""
