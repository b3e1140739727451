"""The simulator's commands of `robocup-vision`, found by entry point.

Each raises RobocupVisionError for anything the user can mend.
"""
