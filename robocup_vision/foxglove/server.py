"""A WebSocket server for the Foxglove viewer, with live ROS 2 messages; the robot's loop never waits for it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any, cast

from field_models.errors import ArgumentError, RobocupVisionError
from field_models.field import Field
from robocup_vision.arrays import Frame, UInt8Array
from robocup_vision.avoidance.steering import SteeringCommand
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.closing import Closing
from robocup_vision.geometry import Pose2
from robocup_vision.messages.topics import TOPIC_TYPES, Outgoing, Topics, TopicSettings
from robocup_vision.messages.types import definition, encode, prepare, to_nanoseconds
from robocup_vision.view import View

NAME = "robocup-vision"


class FoxgloveServer(Closing):
    """Serves one robot's frames and what was seen in them.

    Parameters
    ----------
    port : int
        Port of the server; 0: any free one.
    host : str
        Address to listen on; only programs of this machine reach the default.
    settings : TopicSettings
        Topics that are sent; frames as JPEG by default.

    Raises
    ------
    ArgumentError
        If the port is out of its range.
    RobocupVisionError
        If the extras `foxglove` and `ros` are not installed, or the port is taken.

    Examples
    --------
    >>> server = FoxgloveServer(field, camera, port=8765)  # doctest: +SKIP
    >>> server.show(frame, view, t_s=t_s, odometry=odometry)  # in the robot's loop  # doctest: +SKIP
    """

    def __init__(
        self,
        field: Field,
        camera: OmniCamera | PinholeCamera,
        port: int = 8765,
        host: str = "127.0.0.1",
        settings: TopicSettings = TopicSettings(image_format="jpeg"),
    ) -> None:
        if not 0 <= port <= 65535:
            raise ArgumentError(f"--foxglove must be a port from 0 to 65535, got {port}")
        try:
            import foxglove
        except ImportError as error:
            raise RobocupVisionError(
                f"Foxglove's server needs foxglove-sdk: pip install 'robocup-vision[foxglove,ros]' ({error})"
            ) from None
        prepare(TOPIC_TYPES.values())
        self._foxglove = foxglove
        self._context = foxglove.Context()
        self._topics = Topics(field, camera, settings)
        self._prefix = settings.prefix
        # topics are announced before the first viewer connects, so that it sees all of them at once
        image = "/camera/image" if settings.image_format == "raw" else "/camera/image/compressed"
        topics = (topic for topic in TOPIC_TYPES if not topic.startswith(("/camera/image", "/truth")))
        self._channels = {topic: self._channel(settings.prefix, topic) for topic in (image, *topics)}
        try:
            self._server = foxglove.start_server(name=NAME, host=host, port=port, context=self._context)
        except Exception as error:  # the package raises RuntimeError or OSError
            raise RobocupVisionError(f"{host}:{port} cannot be listened on ({error})") from None
        self.host, self.port = host, int(self._server.port)
        self._changed = threading.Condition()
        self._frame: Callable[[], list[Outgoing]] | None = None
        self._moved: Pose2 | None = None
        self._is_closing = False
        self._skipped = 0
        self._problem = ""
        self._thread = threading.Thread(target=self._run, name="foxglove", daemon=True)
        self._thread.start()

    @property
    def skipped(self) -> int:
        """Number of frames that were not sent because a newer one came first."""
        return self._skipped

    @property
    def problem(self) -> str:
        """Why the last frame could not be sent; empty if it could."""
        return self._problem

    def show(
        self,
        frame: Frame,
        view: View,
        t_s: float | None = None,
        odometry: Pose2 | None = None,
        command: SteeringCommand | None = None,
    ) -> None:
        """Send a frame, what was seen in it, and the command. A frame that is still waiting is replaced and skipped.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            BGR; copied.
        t_s : float, optional
            Time at which it was taken; default: the view's time, else now.
        odometry : Pose2, optional
            The robot's motion since the previous frame, in the robot frame at that time.
        """
        at_s = t_s if t_s is not None else view.t_s if view.t_s is not None else time.time()
        copied = cast("UInt8Array", frame.copy())
        with self._changed:
            if odometry is not None:
                # the motion of skipped frames is kept
                self._moved = odometry if self._moved is None else self._moved.compose(odometry)
            if self._frame is not None:
                self._skipped += 1
            moved = self._moved

            def messages() -> list[Outgoing]:
                out = [] if moved is None else self._topics.of_odometry(moved, at_s)
                out += [*self._topics.of_frame(copied, at_s), *self._topics.of_look(view, at_s)]
                return out if command is None else [*out, *self._topics.of_command(command, at_s)]

            self._frame = messages
            self._changed.notify()

    def close(self) -> None:
        """Send the waiting frame, and stop the server."""
        with self._changed:
            if self._is_closing:
                return
            self._is_closing = True
            self._changed.notify()
        self._thread.join()
        self._server.stop()

    def _run(self) -> None:
        while True:
            with self._changed:
                while self._frame is None and not self._is_closing:
                    self._changed.wait()
                if self._frame is None:
                    return
                messages, self._frame, self._moved = self._frame, None, None
            try:
                for outgoing in messages():
                    self._send(outgoing)
                self._problem = ""
            except Exception as error:  # a frame that cannot be shown must not stop the robot
                self._problem = f"{type(error).__name__}: {' '.join(str(error).split())}"

    def _send(self, outgoing: Outgoing) -> None:
        topic, message, t_s = outgoing
        channel = self._channels[topic if topic.startswith("/tf") else topic.removeprefix(self._prefix)]
        channel.log(encode(message), log_time=max(to_nanoseconds(t_s), 0))

    def _channel(self, prefix: str, topic: str) -> Any:
        name = TOPIC_TYPES[topic]
        schema = self._foxglove.Schema(name=name, encoding="ros2msg", data=definition(name).encode())
        public = topic if topic.startswith("/tf") else prefix + topic
        return self._foxglove.Channel(public, schema=schema, message_encoding="cdr", context=self._context)
