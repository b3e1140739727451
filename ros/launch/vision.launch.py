"""Starts the node: `ros2 launch robocup_vision_ros vision.launch.py field:=ssl_2001 camera:=/path/camera.toml`."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

TEXTS = {
    "field": "ssl_2001",
    "camera": "",
    "colors": "",
    "method": "",
    "half": "",
    "image_topic": "camera/image",
    "camera_info_topic": "camera/camera_info",
    "odometry_topic": "odometry",
    "joint_states_topic": "joint_states",
    "pan_joint": "",
    "tilt_joint": "",
}
SWITCHES = {"memory": "true", "use_tf": "false", "publish_tf": "true", "cmd_vel": "false"}


def generate_launch_description():
    """Declare the node's parameters as arguments of the launch file, and start it in a namespace."""
    parameters = {name: ParameterValue(LaunchConfiguration(name), value_type=str) for name in TEXTS}
    parameters |= {name: ParameterValue(LaunchConfiguration(name), value_type=bool) for name in SWITCHES}
    arguments = [DeclareLaunchArgument(name, default_value=value) for name, value in (TEXTS | SWITCHES).items()]
    node = Node(
        package="robocup_vision_ros",
        executable="vision",
        name="robocup_vision",
        namespace=LaunchConfiguration("namespace"),
        parameters=[parameters],
        output="screen",
    )
    return LaunchDescription([*arguments, DeclareLaunchArgument("namespace", default_value=""), node])
