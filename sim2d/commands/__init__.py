"""The simulator's commands of `robocup-vision`, found by entry point."""
