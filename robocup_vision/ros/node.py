"""The ROS 2 node's logic without ROS itself: messages in, messages out.

It follows REP-103 (units and axes), REP-105 (map -> odom) and REP-120 (base_footprint). A message that cannot be used
is ignored: the diagnostics report the problem, and the log reports it once.
"""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np

from field_models.catalog import load_field
from field_models.errors import ArgumentError, FrameError, PacketError, RobocupVisionError
from robocup_vision.avoidance.steering import Steering
from robocup_vision.camera.files import load_camera
from robocup_vision.camera.pinhole import Mounting, PinholeCamera
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.filter.settings import Half
from robocup_vision.memory import Memory
from robocup_vision.messages.camera_infos import camera_info_problem
from robocup_vision.messages.images import frame_of
from robocup_vision.messages.topics import (
    TOPIC_TYPES,
    FrameNames,
    Outgoing,
    Topics,
    TopicSettings,
    covariance_3x3,
    pose_of,
)
from robocup_vision.messages.types import header, make, time_of
from robocup_vision.motion_limits import MotionLimits
from robocup_vision.perception.color_table import load_colors
from robocup_vision.ros.settings import NodeSettings
from robocup_vision.ros.transforms import HeadJoints, Transforms, mounting_of
from robocup_vision.view import View
from robocup_vision.vision import Vision

_NUMBERS = re.compile(r"\d[\d.e+-]*")
# time without an image after which the diagnostics warn
_SILENT_S = 1.0
# A nodding head moves its camera about this far. If tf and camera file differ by more, the file is wrong.
_SAME_PLACE_M = 0.05
# topics that other nodes publish, or that only recordings have
_NOT_PUBLISHED = ("/camera/", "/odometry", "/truth/")
_OK, _WARN, _ERROR = 0, 1, 2


class Notices:
    """Lasting problems and single events, for diagnostics and log. The log has texts that differ only in numbers once.

    `topic` names what a lasting problem is about: "image", "odometry", ...
    """

    def __init__(self) -> None:
        self._lasting: dict[str, str] = {}
        self._happened: dict[str, str] = {}
        self._logged: set[str] = set()
        self._news: list[str] = []

    def __contains__(self, topic: str) -> bool:
        return topic in self._lasting

    def hold(self, topic: str, text: str) -> None:
        """Report a problem that lasts until `clear`."""
        self._lasting[topic] = text
        self._add_to_log(text)

    def clear(self, topic: str) -> None:
        """Remove the problem of a topic, if it has one."""
        self._lasting.pop(topic, None)

    def note(self, text: str) -> None:
        """Report an event; only the next diagnostics contain it."""
        self._happened[_without_numbers(text)] = text
        self._add_to_log(text)

    def take(self) -> list[str]:
        """Return the lasting problems, and the events since the last call."""
        texts = [*self._lasting.values(), *self._happened.values()]
        self._happened.clear()
        return texts

    def take_news(self) -> list[str]:
        """Return the texts that have not been logged before."""
        news, self._news = self._news, []
        return news

    def _add_to_log(self, text: str) -> None:
        if _without_numbers(text) not in self._logged:
            self._logged.add(_without_numbers(text))
            self._news.append(text)


def _without_numbers(text: str) -> str:
    return _NUMBERS.sub("#", text)


class VisionNode:
    """One robot's vision as a node.

    Raises
    ------
    RobocupVisionError
        If field, camera or colours cannot be loaded or do not fit.
    """

    def __init__(self, settings: NodeSettings) -> None:
        settings.require_files()
        self.settings = settings
        field, camera = load_field(settings.field), load_camera(settings.camera)
        colors = load_colors(settings.colors) if settings.colors else None
        half: Half | None = "own" if settings.half else None
        self._memory = Memory.of_everything(field, half=half) if settings.memory else None
        self.vision = Vision(field, camera, colors, method=settings.method or None, memory=self._memory)
        names = FrameNames(settings.map_frame, settings.odom_frame, settings.robot_frame, settings.camera_frame)
        # other nodes publish the image, and with `use_tf` the camera's transform too
        topic_settings = TopicSettings(
            settings.prefix,
            names,
            image_format=None,
            camera_transform=not settings.use_tf,
            markings=settings.markings,
        )
        self._topics = Topics(field, camera, topic_settings)
        limits = MotionLimits(settings.speed_mps, settings.acceleration_mps2, settings.dead_time_s)
        self._steering = Steering(settings.robot_radius_m or field.robot_radius_m, limits)
        self._odometry: Pose2 | None = None
        self._velocity_mps = (0.0, 0.0)
        self._at_last_frame: Pose2 | None = None
        self._initial: PoseEstimate | None = None
        self._goal: Pose2 | None = None
        self._last_s: float | None = None
        self._last_image_s: float | None = None
        self._notices = Notices()
        self._frames = self._located = 0
        self._reason, self._took_s = "", 0.0
        self._transforms = Transforms()
        self._joints = self._head_joints()
        # an image whose transforms or joints have not been received yet, and its time
        self._waiting: tuple[Any, float] | None = None

    def take_news(self) -> list[str]:
        """Return the warnings for the log; each is returned once, however often it occurs."""
        return self._notices.take_news()

    @property
    def published(self) -> dict[str, str]:
        """The types of all messages that may be published, by topic."""
        has = {
            "/tf": self.settings.publish_tf,
            "/tf_static": not self.settings.use_tf,
            "/tracks": self.settings.memory,
            "/map": self.settings.memory,
            "/cmd_vel": self.settings.cmd_vel,
            "/markings": self.settings.markings,
            "/goalposts": self.settings.markings,
        }
        topics = {
            (topic if topic.startswith("/tf") else self.settings.prefix + topic): name
            for topic, name in TOPIC_TYPES.items()
            if not topic.startswith(_NOT_PUBLISHED) and has.get(topic, True)
        }
        return {**topics, "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray"}

    def on_image(self, message: Any, now_s: float) -> list[Outgoing]:
        """Look at an Image or CompressedImage; return the messages to publish.

        Parameters
        ----------
        now_s : float
            The clock's time; replaces a stamp that is zero.
        """
        self._last_image_s = now_s
        t_s = time_of(message, now_s)
        self._note_time(t_s)
        if not (self.settings.use_tf or self.settings.has_joints):
            return self._look_at(message, t_s, None)
        if self._waiting is not None:
            source = "tf" if self.settings.use_tf else self.settings.joint_states_topic
            self._notices.hold(
                "mounting", f"{source} does not tell how the camera was held at {self._waiting[1]:.3f} s: not looked at"
            )
        self._waiting = (message, t_s)
        return self._look_when_mounting_known()

    def on_tf(self, message: Any, now_s: float) -> list[Outgoing]:
        """Take in a tf2_msgs/TFMessage, with `use_tf`; process an image that waits for it."""
        self._transforms.add(message, is_static=False)
        return self._look_when_mounting_known()

    def on_tf_static(self, message: Any, now_s: float) -> list[Outgoing]:
        """Take in a tf2_msgs/TFMessage of fixed transforms; process an image that waits for it."""
        self._transforms.add(message, is_static=True)
        return self._look_when_mounting_known()

    def on_joint_states(self, message: Any, now_s: float) -> list[Outgoing]:
        """Take in a sensor_msgs/JointState, with `pan_joint` or `tilt_joint`; process an image that waits for it."""
        if self._joints is not None:
            self._joints.add(message, time_of(message, now_s))
        return self._look_when_mounting_known()

    def _look_when_mounting_known(self) -> list[Outgoing]:
        """Process the waiting image, once tf or the joints give the camera's mounting at its time."""
        if self._waiting is None:
            return []
        message, t_s = self._waiting
        if self._joints is not None:
            mounting = self._joints.mounting_at(t_s)
            if mounting is None:
                return []
            self._waiting = None
            self._notices.clear("mounting")
            return self._look_at(message, t_s, mounting)
        frame = message.header.frame_id.lstrip("/") or self.settings.camera_frame
        found = self._transforms.lookup(self.settings.robot_frame, frame, t_s)
        if found is None:
            return []
        self._waiting = None
        try:
            mounting = mounting_of(*found)
        except ArgumentError as error:
            self._notices.hold("mounting", f"tf: {error}")
            return []
        off_m = math.dist(found[1][:2].tolist(), self.vision.camera.offset_m)
        if off_m > _SAME_PLACE_M:
            self._notices.hold(
                "mounting",
                f"tf puts the camera at {found[1][0]:.3f}, {found[1][1]:.3f} m, the camera file's offset_m is"
                f" {self.vision.camera.offset_m}: the file's is taken",
            )
        else:
            self._notices.clear("mounting")
        return self._look_at(message, t_s, mounting)

    def _look_at(self, message: Any, t_s: float, mounting: Mounting | None) -> list[Outgoing]:
        try:
            frame = frame_of(message)
            view = self._look(frame, t_s, mounting)
        except (FrameError, RobocupVisionError) as error:
            self._notices.hold("image", str(error))
            return []
        self._notices.clear("image")
        for warning in view.warnings:
            self._notices.note(warning)
        self._frames += 1
        self._located += bool(view.pose)
        self._reason = "" if isinstance(view.pose, PoseEstimate) else view.pose.reason
        self._took_s = float(view.timings_s["total"])
        out = list(self._topics.of_look(view, t_s))
        if not self.settings.publish_tf:
            out = [outgoing for outgoing in out if outgoing.topic != "/tf"]
        return [*out, *self._steer(view, t_s)]

    def on_odometry(self, message: Any, now_s: float) -> list[Outgoing]:
        """Take in a nav_msgs/Odometry: predict the pose by the motion since the one before."""
        t_s = time_of(message, now_s)
        pose, twist = self._pose_in("odometry", message.pose.pose), message.twist.twist
        if pose is None:
            return []
        if not (math.isfinite(twist.linear.x) and math.isfinite(twist.linear.y)):
            self._notices.hold("odometry", "odometry: the velocity is not finite: left out")
            return []
        self._note_time(t_s)
        motion = Pose2(0.0, 0.0, 0.0) if self._odometry is None else self._odometry.inverse().compose(pose)
        self._odometry, self._velocity_mps = pose, (float(twist.linear.x), float(twist.linear.y))
        try:
            if self._memory is not None:
                self.vision.predict(motion, t_s)
        except RobocupVisionError as error:
            self._notices.hold("odometry", str(error))
            return []
        self._notices.clear("odometry")
        self._topics.at_odometry(pose)
        return []

    def on_camera_info(self, message: Any, now_s: float) -> list[Outgoing]:
        """Compare a sensor_msgs/CameraInfo with the camera file; the diagnostics report a difference."""
        problem = camera_info_problem(message, self.vision.camera)
        if problem:
            self._notices.hold("camera_info", problem)
        else:
            self._notices.clear("camera_info")
        return []

    def on_initial_pose(self, message: Any, now_s: float) -> list[Outgoing]:
        """Take in the robot's pose, geometry_msgs/PoseWithCovarianceStamped: the belief is forgotten."""
        if not self._is_in_map("initialpose", message):
            return []
        pose, covariance = self._pose_in("initialpose", message.pose.pose), covariance_3x3(message.pose.covariance)
        if pose is None:
            return []
        if not np.isfinite(covariance).all():
            self._notices.hold("initialpose", "initialpose: the covariance is not finite: left out")
            return []
        self._notices.clear("initialpose")
        self._initial = PoseEstimate(pose, covariance, 1.0, 0.0)
        if self._memory is not None:
            self._memory.poses.forget()
            self._memory.poses.expect(pose)
        return []

    def on_goal(self, message: Any, now_s: float) -> list[Outgoing]:
        """Take in the target to drive to, with `cmd_vel`: a geometry_msgs/PoseStamped, map frame."""
        if not self._is_in_map("goal_pose", message):
            return []
        goal = self._pose_in("goal_pose", message.pose)
        if goal is None:
            return []
        self._notices.clear("goal_pose")
        self._goal = goal
        return []

    def diagnostics(self, now_s: float, notes: tuple[str, ...] = ()) -> list[Outgoing]:
        """Return a diagnostic_msgs/DiagnosticArray about the frames and problems since the last call.

        Parameters
        ----------
        notes : tuple of str
            Further notes, such as message types that are not installed.
        """
        problems = self._notices.take()
        if self._last_image_s is None:
            problems.append(f"no image has come on {self.settings.image_topic} yet")
        elif now_s - self._last_image_s > _SILENT_S:
            problems.append(f"no image for {now_s - self._last_image_s:.1f} s")
        level = _ERROR if "image" in self._notices else _WARN if problems else _OK
        text = "; ".join(problems) if problems else f"{self._located} of {self._frames} frames located"
        values = {
            "frames": str(self._frames),
            "located": str(self._located),
            "last not located because": self._reason,
            "time per frame": f"{1e3 * self._took_s:.2f} ms",
            "notes": "; ".join(notes),
        }
        self._frames = self._located = 0
        status = (level, "robocup_vision", text, "", list(values.items()))
        message = make("diagnostic_msgs/msg/DiagnosticArray", header(now_s, ""), [status])
        return [Outgoing("/diagnostics", message, now_s)]

    def _head_joints(self) -> HeadJoints | None:
        if not self.settings.has_joints:
            return None
        if not isinstance(self.vision.camera, PinholeCamera):
            raise ArgumentError("pan_joint and tilt_joint are for cameras that look ahead")
        return HeadJoints(self.settings.pan_joint, self.settings.tilt_joint, self.vision.camera)

    def _is_in_map(self, topic: str, message: Any) -> bool:
        frame, ours = message.header.frame_id, self.settings.map_frame
        if frame in ("", ours):
            return True
        self._notices.hold(topic, f"{topic} is in frame {frame!r}, must be in {ours!r}")
        return False

    def _pose_in(self, topic: str, message: Any) -> Pose2 | None:
        """Return the pose of a message; None if it is invalid, which the diagnostics report."""
        try:
            return pose_of(message)
        except PacketError as error:
            self._notices.hold(topic, f"{topic}: {error}: left out")
            return None

    def _look(self, frame: Any, t_s: float, mounting: Mounting | None) -> View:
        motion, odometry = None, self._odometry if self._memory is None else None
        if odometry is not None and self._at_last_frame is not None:
            motion = self._at_last_frame.inverse().compose(odometry)
        view = self.vision.look(frame, t_s, motion, self._initial, mounting=mounting)
        # not before: a frame that is refused leaves them to the next one
        self._initial = None
        if odometry is not None:
            self._at_last_frame = odometry
        return view

    def _note_time(self, t_s: float) -> None:
        """Forget everything if time jumps back, as when a bag is played again: filters only run forwards."""
        # not for a small step back: a camera's stamps may be older than the odometry's
        if self._last_s is not None and t_s < self._last_s - _SILENT_S:
            self.vision.forget()
            self._steering.forget()
            self._odometry = self._at_last_frame = None
            self._notices.note(f"time went back from {self._last_s:.3f} s to {t_s:.3f} s: all is forgotten")
            self._last_s = t_s
        else:
            self._last_s = t_s if self._last_s is None else max(self._last_s, t_s)

    def _steer(self, view: View, t_s: float) -> list[Outgoing]:
        if not self.settings.cmd_vel or self._goal is None:
            return []
        believed = view.pose if view.belief is None else view.belief.pose
        if not isinstance(believed, PoseEstimate) or len(view.free_space.range_m) < 3:
            # without a pose or free space the robot stops
            return self._topics.of_command((0.0, 0.0, 0.0), t_s)
        there = believed.pose.inverse().compose(self._goal)
        distance_m, bearing_rad = math.hypot(there.x_m, there.y_m), math.atan2(there.y_m, there.x_m)
        command = self._steering.steer(view.free_space, self._velocity_mps, bearing_rad, distance_m)
        return self._topics.of_command(command, t_s)
