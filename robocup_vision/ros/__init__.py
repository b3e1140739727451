"""The ROS 2 node: what it does is in `node`, on plain values; `bridge` alone imports rclpy."""
