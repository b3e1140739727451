"""ROS 2 messages of what `Vision`, `Memory` and `Steering` estimate; needs the extra `ros`, but no ROS installation."""
