"""What is remembered over frames: the robot's own motion, and a map of the free floor."""
