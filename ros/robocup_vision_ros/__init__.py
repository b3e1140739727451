"""The ROS 2 package of robocup-vision's node."""
