"""The live page: what it costs the robot's loop."""
