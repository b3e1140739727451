"""An image topic of ROS 2 as a source of frames: ``ros:/camera/image_raw[,odometry=/odom]``.

`TopicSource` needs no ROS: messages come in by its methods. Only `_Listener` imports rclpy. It watches the types that
are published, so that raw and compressed topics need no option, and a topic of a wrong type is reported.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from typing import Any, Protocol

from field_models.errors import ArgumentError, PacketError, RobocupVisionError
from robocup_vision.closing import Closing
from robocup_vision.geometry import Pose2
from robocup_vision.live.handover.moment import RobotSetup
from robocup_vision.live.sources.source import (
    Newest,
    Source,
    SourceFrame,
    SourceOptions,
    setup_by_options,
    vision_by_options,
)
from robocup_vision.messages.images import IMAGE_TYPES, frame_of
from robocup_vision.messages.topics import pose_of
from robocup_vision.messages.types import time_of
from robocup_vision.ros.type_support import require_rclpy, subscribe
from robocup_vision.vision import Vision

ODOMETRY_TYPES = ("nav_msgs/msg/Odometry",)
_NODE_NAME = "robocup_vision_live"
# stamps may be slightly out of order; if time goes back by more than this, a bag was restarted
_BACK_S = 1.0
# time between two checks of the types that are published
_WATCH_S = 0.5
_CLOSE_S = 2.0


class Subscriber(Protocol):
    """A subscription to topics that can be closed."""

    def close(self) -> None:
        """Stop listening."""
        ...


Handler = Callable[[Any, float], None]
# Subscribes to topics; arguments: by topic its accepted types and the handler of its messages, and a callback that
# receives a topic and its problem (empty: none).
Listen = Callable[[Mapping[str, tuple[tuple[str, ...], Handler]], Callable[[str, str], None]], Subscriber]


class TopicSource(Source):
    """Gives the newest frame of a topic of Image or CompressedImage.

    Without a topic of Odometry the robot's motion is unknown. `listen` subscribes to the topics; by default it uses
    rclpy. Raises RobocupVisionError if rclpy is not installed, or an option is wrong.
    """

    waits = False

    def __init__(
        self, image_topic: str, odometry_topic: str | None, options: SourceOptions, listen: Listen | None = None
    ) -> None:
        self.name = image_topic
        self._options, self._has_odometry = options, odometry_topic is not None
        self.setups = (setup_by_options(image_topic, options),)
        self._newest = Newest[tuple[Any, float, Pose2 | None]]()
        self._odometry: Pose2 | None = None
        self._at_last_frame: Pose2 | None = None
        self._first_s: float | None = None
        self._last_s = 0.0
        self._problems: dict[str, str] = {}
        self._note(image_topic, "no image has come yet")
        topics: dict[str, tuple[tuple[str, ...], Handler]] = {image_topic: (IMAGE_TYPES, self.on_image)}
        if odometry_topic is not None:
            topics[odometry_topic] = (ODOMETRY_TYPES, self.on_odometry)
        self._listener = (listen or _Listener)(topics, self._on_problem)

    def make_vision(self, setup: RobotSetup) -> Vision | None:
        """Return the `Vision` for the frames; see `Source.make_vision`."""
        return vision_by_options(setup, self._options, has_odometry=self._has_odometry)

    def on_image(self, message: Any, now_s: float) -> None:
        """Take in an Image or CompressedImage; the clock's time `now_s` replaces a stamp that is zero."""
        self._note(self.name, "")
        self._newest.put((message, time_of(message, now_s), self._odometry))

    def on_odometry(self, message: Any, now_s: float) -> None:
        """Take in a nav_msgs/Odometry; one with an invalid pose is ignored."""
        with suppress(PacketError):
            self._odometry = pose_of(message.pose.pose)

    def read(self, timeout_s: float) -> tuple[SourceFrame, ...] | None:
        """Return the newest frame if it has not been read yet; raises as `Source.read`."""
        newest = self._newest.take(timeout_s)
        if newest is None:
            return None if self._newest.is_closed else ()
        message, stamp_s, odometry = newest
        frame = frame_of(message)
        t_s, is_new = self._time_of(stamp_s)
        before, self._at_last_frame = self._at_last_frame, odometry
        motion = None if before is None or odometry is None or is_new else before.inverse().compose(odometry)
        if motion is None and self._has_odometry:
            motion = Pose2(0.0, 0.0, 0.0)
        return (SourceFrame(self.name, frame, t_s, motion, alone=is_new),)

    def _time_of(self, stamp_s: float) -> tuple[float, bool]:
        """Return the time since the first frame, and whether the stamps have jumped back, so that a new run begins."""
        if self._first_s is None:
            self._first_s = stamp_s
        t_s = stamp_s - self._first_s
        goes_back = t_s < self._last_s - _BACK_S
        if goes_back:
            # the page's own time does not jump back
            self._first_s, t_s = stamp_s - self._last_s, self._last_s
        self._last_s = max(self._last_s, t_s)
        return self._last_s, goes_back

    def close(self) -> None:
        """Stop listening."""
        self._newest.close()
        self._listener.close()

    def _on_problem(self, topic: str, problem: str) -> None:
        if problem or topic != self.name:
            self._note(topic, problem)

    def _note(self, topic: str, problem: str) -> None:
        self._problems[topic] = problem
        self.problem = next((text for text in tuple(self._problems.values()) if text), "")


def open_topic(text: str, options: SourceOptions) -> TopicSource:
    """Open ``/camera/image_raw[,odometry=/odom]``.

    Raises ArgumentError if the text has another form; otherwise as `TopicSource`.
    """
    image_topic, *rest = text.split(",")
    odometry_topic = None
    for word in rest:
        name, _, value = word.partition("=")
        if name != "odometry" or not value:
            raise ArgumentError(f"ros:{text}: '{word}' is no option of an image topic, must be odometry=TOPIC")
        odometry_topic = value
    if not image_topic:
        raise ArgumentError("ros: names no topic, must be such as ros:/camera/image_raw")
    return TopicSource(image_topic, odometry_topic, options)


class _Listener(Closing):
    """Subscribes to topics by rclpy, in its own context and thread."""

    def __init__(
        self, topics: Mapping[str, tuple[tuple[str, ...], Handler]], on_problem: Callable[[str, str], None]
    ) -> None:
        require_rclpy("a ROS topic")
        import rclpy
        from rclpy.executors import SingleThreadedExecutor

        self._topics, self._on_problem = topics, on_problem
        self._context = rclpy.Context()
        self._context.init()
        self._node = rclpy.create_node(_NODE_NAME, context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._heard: dict[str, tuple[str, Any]] = {}
        self._node.create_timer(_WATCH_S, self._watch)
        self._thread = threading.Thread(target=self._spin, name="ros topics", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop listening."""
        # a context that has been shut down ends the thread
        self._context.try_shutdown()
        self._thread.join(_CLOSE_S)
        self._executor.shutdown(timeout_sec=0.0)
        self._node.destroy_node()

    def _spin(self) -> None:
        from rclpy.executors import ExternalShutdownException

        with suppress(ExternalShutdownException):
            self._watch()
            while self._context.ok():
                self._executor.spin_once(timeout_sec=_WATCH_S)

    def _watch(self) -> None:
        """Subscribe to the topics by the types that are published now, and report problems."""
        published = dict(self._node.get_topic_names_and_types())
        for topic, (wanted, handler) in self._topics.items():
            full = self._node.resolve_topic_name(topic)
            kinds = published.get(full, [])
            kind = next((kind for kind in kinds if kind in wanted), None)
            if kind is None:
                names = " or ".join(wanted)
                problem = f"is of type {', '.join(kinds)}, must be {names}" if kinds else "nobody publishes it"
                self._on_problem(topic, f"topic {full}: {problem}")
            elif self._heard.get(topic, ("",))[0] != kind:
                self._on_problem(topic, self._subscribe(topic, kind, handler))

    def _subscribe(self, topic: str, kind: str, handler: Handler) -> str:
        # only the newest image is of interest
        depth = 1 if kind in IMAGE_TYPES else 50
        try:
            subscription = subscribe(
                self._node,
                topic,
                kind,
                lambda message: handler(message, time.time()),
                partial(self._on_problem, topic),
                depth,
            )
        except RobocupVisionError as error:
            return str(error)
        old = self._heard.get(topic)
        if old is not None:
            self._node.destroy_subscription(old[1])
        self._heard[topic] = kind, subscription
        return ""
