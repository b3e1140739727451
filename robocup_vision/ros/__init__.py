"""The ROS 2 node: its functions are in `node`, without ROS; only `bridge` imports rclpy."""
