"""Bags of any ROS program: their files, the times and poses in them, and a dataset of their frames."""
