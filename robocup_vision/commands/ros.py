"""`robocup-vision ros`: its options and its handler."""

from __future__ import annotations

import argparse
from typing import Any

# (option, help, default); the defaults are those of ros.settings, which a test compares
_TEXTS = (
    ("field", "built-in field or field file", ""),
    ("camera", "camera file", ""),
    ("colors", "colour file (default: learnt)", ""),
    ("method", "how the pose is found (default: by camera)", ""),
    ("half", "own: the robot begins in its own half, x < 0 (default: not known)", ""),
    ("image_topic", "topic of images, raw or .../compressed", "camera/image"),
    ("camera_info_topic", "topic of sensor_msgs/CameraInfo", "camera/camera_info"),
    ("odometry_topic", "topic of nav_msgs/Odometry", "odometry"),
    ("joint_states_topic", "topic of sensor_msgs/JointState", "joint_states"),
    ("pan_joint", "joint that adds to the camera file's pan, to the left (-NAME subtracts)", ""),
    ("tilt_joint", "joint that adds to the camera file's tilt, up (-NAME subtracts: --tilt-joint=-NAME)", ""),
    ("prefix", "before every published topic, such as /robot1", ""),
    ("map_frame", "frame of the field", "map"),
    ("odom_frame", "frame of the odometry", "odom"),
    ("robot_frame", "frame of the robot on the floor", "base_footprint"),
    ("camera_frame", "optical frame of the camera", "camera_optical_frame"),
)
_NUMBERS = (
    ("robot_radius_m", "radius with clearance, 0: the league's", 0.0),
    ("speed_mps", "largest speed", 0.4),
    ("acceleration_mps2", "largest acceleration", 0.3),
    ("dead_time_s", "from a command until the robot obeys", 0.05),
)
_SWITCHES = (
    ("memory", "join frames over time", True),
    ("use_tf", "camera's pan, tilt, roll and height by tf at each image's stamp", False),
    ("publish_tf", "publish map -> odom", True),
    ("markings", "publish markings and goalposts", False),
    ("cmd_vel", "drive to goal_pose", False),
)


def add_parser(subparsers: Any) -> None:
    """Add the command `ros`."""
    parser = subparsers.add_parser(
        "ros",
        help="run as a ROS 2 node: images in; pose, scan, balls, obstacles, map out",
        description="Run as a ROS 2 node. Each option is a parameter of the same name, too; what follows --ros-args is "
        "handed on to ROS. Needs the extra ros and rclpy.",
    )
    for name, text, default in _TEXTS:
        parser.add_argument(_option(name), default=default, metavar="X", help=text + _default(default))
    for name, text, number in _NUMBERS:
        parser.add_argument(
            _option(name), type=float, default=number, metavar="X", help=f"{text} (default: {number:g})"
        )
    for name, text, is_on in _SWITCHES:
        shown = "yes" if is_on else "no"
        parser.add_argument(
            _option(name), action=argparse.BooleanOptionalAction, default=is_on, help=f"{text} (default: {shown})"
        )
    parser.add_argument("--ros-args", nargs=argparse.REMAINDER, default=[], help="what follows is for ROS")
    parser.set_defaults(run=run_ros)


def run_ros(options: argparse.Namespace) -> int:
    """Run the node until it is interrupted; return 0."""
    from robocup_vision.ros.bridge import run_node
    from robocup_vision.ros.settings import NodeSettings

    settings = NodeSettings(**{name: getattr(options, name) for name in NodeSettings.names()})
    run_node(settings, ["--ros-args", *options.ros_args] if options.ros_args else [])
    return 0


def _option(name: str) -> str:
    return "--" + name.replace("_", "-")


def _default(text: str) -> str:
    return f" (default: {text})" if text else ""
