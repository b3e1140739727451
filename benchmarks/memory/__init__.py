"""What is estimated over time: the pose, free space, the own motion, the other robots."""
