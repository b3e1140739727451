"""`ros2 run robocup_vision_ros vision --ros-args -p field:=ssl_2001 -p camera:=camera.toml`."""

import sys

from robocup_vision import cli


def main() -> int:
    """Run the node with ROS' own arguments; options of `robocup-vision ros` may stand before them."""
    return cli.main(["ros", *sys.argv[1:]])
