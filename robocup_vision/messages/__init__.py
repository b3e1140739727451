"""ROS 2 messages for the results of `Vision`, `Memory` and `Steering`; needs the extra `ros`, but not ROS itself."""
