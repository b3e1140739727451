"""Settings of the ROS 2 node: its options and, with the same names, its parameters."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from field_models.errors import ArgumentError
from robocup_vision.checks import require_not_negative


@dataclass(frozen=True, slots=True)
class NodeSettings:
    """Options of the node; each is also a ROS parameter.

    Parameters
    ----------
    field : str
        Built-in field or field file.
    camera : str
        Camera file.
    colors : str
        Colour file; empty: colours are learnt.
    method : str
        Method of localisation; empty: the camera's default.
    memory : bool
        Whether frames are combined over time: tracks, a map, and a pose that odometry continues.
    half : str
        "own": the robot begins in its own half, x < 0 (`Memory`); empty: frames decide, if they can.
    image_topic, camera_info_topic, odometry_topic, joint_states_topic : str
        Subscribed topics. An image topic that ends in ``/compressed`` has compressed images.
    prefix : str
        Put before every published topic, such as ``/robot1``; remappings are another way.
    map_frame, odom_frame, robot_frame, camera_frame : str
        Names of the coordinate frames.
    use_tf : bool
        Whether pan, tilt, roll and height of the camera are taken from tf at each image's stamp: `camera_frame`, or the
        image's own frame, in `robot_frame`. Their standard deviations are those of the camera file.
    pan_joint, tilt_joint : str
        Joints of `joint_states_topic` whose positions at each image's stamp are added to the camera file's pan (left)
        and tilt (up). ``-NAME`` subtracts: a tilt joint about y, as in most URDFs, lowers the view. Empty: none.
    publish_tf : bool
        Whether map -> odom is published; odom -> robot_frame must be published by the source of odometry.
    markings : bool
        Whether ``markings`` and ``goalposts`` are published; finding them takes longer than the rest of a look.
    cmd_vel : bool
        Whether to drive to ``goal_pose`` (geometry_msgs/PoseStamped, map frame), with commands on ``cmd_vel``.
    robot_radius_m : float
        Radius of the robot plus the wanted clearance; 0: that of the field's league.
    speed_mps, acceleration_mps2, dead_time_s : float
        Limits of the robot's motion, for `cmd_vel`.

    Raises
    ------
    ArgumentError
        If a value is out of its range.
    """

    field: str = ""
    camera: str = ""
    colors: str = ""
    method: str = ""
    memory: bool = True
    half: str = ""
    image_topic: str = "camera/image"
    camera_info_topic: str = "camera/camera_info"
    odometry_topic: str = "odometry"
    joint_states_topic: str = "joint_states"
    prefix: str = ""
    map_frame: str = "map"
    odom_frame: str = "odom"
    robot_frame: str = "base_footprint"
    camera_frame: str = "camera_optical_frame"
    use_tf: bool = False
    pan_joint: str = ""
    tilt_joint: str = ""
    publish_tf: bool = True
    markings: bool = False
    cmd_vel: bool = False
    robot_radius_m: float = 0.0
    speed_mps: float = 0.4
    acceleration_mps2: float = 0.3
    dead_time_s: float = 0.05

    def __post_init__(self) -> None:
        require_not_negative(self, "robot_radius_m")
        if self.half not in ("", "own"):
            raise ArgumentError(f"half must be 'own' or empty, got {self.half!r}")
        if self.half and not self.memory:
            raise ArgumentError("half is for the memory, which is off")
        if self.use_tf and self.has_joints:
            raise ArgumentError("use_tf tells the camera's pan and tilt already: leave out pan_joint and tilt_joint")
        for name in ("image_topic", "camera_info_topic", "odometry_topic", "joint_states_topic"):
            if not getattr(self, name):
                raise ArgumentError(f"{name} must not be empty")

    @property
    def has_joints(self) -> bool:
        """Whether the camera's orientation is taken from joints."""
        return bool(self.pan_joint or self.tilt_joint)

    def require_files(self) -> None:
        """Refuse settings without a field or a camera.

        Raises
        ------
        ArgumentError
            If one is missing.
        """
        for name in ("field", "camera"):
            if not getattr(self, name):
                raise ArgumentError(f"the node needs --{name} (parameter '{name}')")

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Names of all options, in order."""
        return tuple(f.name for f in dataclasses.fields(cls))
