"""Connects the node with ROS 2 by rclpy, as installed with ROS or from wheels. The rest of the node is in `node`.

Messages are passed as CDR bytes; their types come from installed packages or are made (`type_support`). Topics whose
types are not available are skipped, and named in the log and the diagnostics.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from field_models.errors import ArgumentError
from robocup_vision.messages.topics import Outgoing
from robocup_vision.messages.types import encode, prepare
from robocup_vision.ros.node import VisionNode
from robocup_vision.ros.settings import NodeSettings
from robocup_vision.ros.type_support import forget_error, raw_class, require_rclpy, subscribe

NODE_NAME = "robocup_vision"
_DIAGNOSTICS_S = 1.0
# topics that late subscribers also need
_LATCHED = ("/map", "/tf_static")
_ABSOLUTE = ("/tf", "/tf_static", "/diagnostics")

Handler = Callable[[Any, float], list[Outgoing]]


def run_node(settings: NodeSettings, arguments: Sequence[str] = ()) -> None:
    """Run the node until it is interrupted; ROS parameters of the same names take precedence over its settings.

    Raises RobocupVisionError if rclpy or the standard messages are not installed, or an option is wrong.
    """
    require_rclpy("the node")
    import rclpy
    from rclpy.executors import ExternalShutdownException

    rclpy.init(args=list(arguments))
    try:
        node = rclpy.create_node(NODE_NAME)
        try:
            _Bridge(node, _with_parameters(node, settings))
            rclpy.spin(node)
        finally:
            node.destroy_node()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


def _with_parameters(node: Any, settings: NodeSettings) -> NodeSettings:
    """Declare every option as a parameter; return the settings with the parameters' values."""
    values = {}
    for name in NodeSettings.names():
        default = getattr(settings, name)
        try:
            values[name] = node.declare_parameter(name, default).value
        except Exception as error:  # rclpy raises its own exceptions for a wrong type
            kind = type(default).__name__
            raise ArgumentError(f"parameter '{name}' must be of type {kind} ({' '.join(str(error).split())})") from None
    return dataclasses.replace(settings, **values)


class _Bridge:
    """Subscribes, publishes, and passes messages on."""

    def __init__(self, node: Any, settings: NodeSettings) -> None:
        self._node, self._settings = node, settings
        self._vision = VisionNode(settings)
        self._missing: list[str] = []
        self._publishers = self._make_publishers()
        image = "CompressedImage" if settings.image_topic.endswith("/compressed") else "Image"
        # only the newest image is of interest
        self._listen(settings.image_topic, f"sensor_msgs/msg/{image}", self._vision.on_image, depth=1)
        info = "sensor_msgs/msg/CameraInfo"
        self._listen(settings.camera_info_topic, info, self._vision.on_camera_info, depth=1)
        self._listen(settings.odometry_topic, "nav_msgs/msg/Odometry", self._vision.on_odometry, depth=50)
        pose = "geometry_msgs/msg/PoseWithCovarianceStamped"
        self._listen("initialpose", pose, self._vision.on_initial_pose, depth=1)
        if settings.use_tf:
            self._listen("/tf", "tf2_msgs/msg/TFMessage", self._vision.on_tf, depth=100)
            self._listen("/tf_static", "tf2_msgs/msg/TFMessage", self._vision.on_tf_static, depth=100)
        if settings.has_joints:
            joints = "sensor_msgs/msg/JointState"
            self._listen(settings.joint_states_topic, joints, self._vision.on_joint_states, depth=100)
        if settings.cmd_vel:
            self._listen("goal_pose", "geometry_msgs/msg/PoseStamped", self._vision.on_goal, depth=1)
        node.create_timer(_DIAGNOSTICS_S, self._tell_diagnostics)
        node.get_logger().info(f"listening to {settings.image_topic}; field {settings.field}, camera {settings.camera}")

    def _listen(self, topic: str, name: str, handler: Handler, depth: int) -> None:
        def on_message(message: Any) -> None:
            self._send(handler(message, self._now_s()))
            for text in self._vision.take_news():
                self._node.get_logger().warning(text)

        # also messages from before the node started
        is_latched = topic == "/tf_static"
        subscribe(self._node, topic, name, on_message, self._warn, depth, is_latched=is_latched)

    def _warn(self, problem: str) -> None:
        self._node.get_logger().warning(problem, throttle_duration_sec=1.0)

    def _send(self, messages: Iterable[Outgoing]) -> None:
        for topic, message, _ in messages:
            publisher = self._publishers.get(topic)
            if publisher is not None:
                publisher.publish(encode(message))

    def _make_publishers(self) -> dict[str, Any]:
        from rclpy.qos import DurabilityPolicy, QoSProfile

        publishers = {}
        for topic, name in self._vision.published.items():
            kind = raw_class(name)
            if kind is None:
                self._missing.append(f"{topic} ({name.split('/')[0]})")
                continue
            is_latched = topic.endswith(_LATCHED)
            durability = DurabilityPolicy.TRANSIENT_LOCAL if is_latched else DurabilityPolicy.VOLATILE
            quality = QoSProfile(depth=1 if is_latched else 10, durability=durability)
            # relative names, so that namespaces and remappings apply
            public = topic if topic in _ABSOLUTE or self._settings.prefix else topic.removeprefix("/")
            publishers[topic] = self._node.create_publisher(kind, public, quality)
            forget_error()
        prepare(self._vision.published.values())
        if self._missing:
            self._node.get_logger().warning(
                f"not published, for their packages are not installed: {', '.join(self._missing)}"
            )
        return publishers

    def _tell_diagnostics(self) -> None:
        notes = tuple(f"{topic} is not installed" for topic in self._missing)
        self._send(self._vision.diagnostics(self._now_s(), notes))

    def _now_s(self) -> float:
        return 1e-9 * float(self._node.get_clock().now().nanoseconds)
