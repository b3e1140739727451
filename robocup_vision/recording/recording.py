"""Reads a recording: the description of the run, its calls one by one with their frames, and its messages."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from field_models.errors import FileError, PacketError
from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import Mounting, PinholeCamera
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.messages.images import IMAGE_TYPES, frame_of
from robocup_vision.messages.topics import pose_of
from robocup_vision.messages.types import CALL, decode, to_nanoseconds
from robocup_vision.perception.color_table import Colors
from robocup_vision.recording.call_writer import RUN_ATTACHMENT, VERSIONS_ATTACHMENT
from robocup_vision.recording.calls import Call
from robocup_vision.recording.log_reader import Logged, LogReader
from robocup_vision.recording.loops import loop_kind
from robocup_vision.recording.run import Run
from robocup_vision.recording.values import value_codec

_TRUTH, _COMMAND = "/truth/pose", "/cmd_vel"


@dataclass(frozen=True, slots=True, eq=False)
class RecordedFrame:
    """One frame of a recording, with the arguments of `Vision.look`.

    Parameters
    ----------
    t_s : float
        Time of the frame.
    frame : (H, W, 3) uint8
        BGR.
    odometry : Pose2 or None
        The robot's motion since the frame before, in the robot frame at that time; None: unknown.
    prior : PoseEstimate, Pose2 or None
        The prior of the call.
    mounting : Mounting or None
        Mounting of the camera on a head; None: as in the camera file.
    """

    t_s: float
    frame: UInt8Array
    odometry: Pose2 | None
    prior: PoseEstimate | Pose2 | None
    mounting: Mounting | None


class Recording:
    """A file that a `Recorder` has written; it may be truncated.

    Raises
    ------
    FileError
        If it cannot be read, or is not a recording of this library.
    RobocupVisionError
        If the extra `ros`, or the program of the recorded loop, is not installed.
    """

    def __init__(self, path: str | Path) -> None:
        self._log = LogReader(path)
        self.path = self._log.path
        if RUN_ATTACHMENT not in self._log.attachments:
            raise FileError(path, "is an MCAP file, but no recording of robocup-vision (it has no run.json)")
        data = self._log.attachments[RUN_ATTACHMENT]
        try:
            self._kind = loop_kind(str(json.loads(data)["fields"]["loop"]))
            self._codec = value_codec(self._kind.types)
            self.run: Run = self._codec.from_json(data)
        except (PacketError, KeyError, ValueError, TypeError) as error:
            raise FileError(path, f"was written by another version: its run.json cannot be read ({error})") from None

    @property
    def field(self) -> Field:
        """The pitch."""
        return self.run.field

    @property
    def camera(self) -> OmniCamera | PinholeCamera:
        """The robot's camera."""
        return self.run.camera

    @property
    def colors(self) -> Colors | None:
        """Fixed colours; None if they were learnt."""
        return self.run.colors

    @property
    def is_whole(self) -> bool:
        """Whether the recorder was closed; False: the file is truncated, and is read up to its last complete chunk."""
        return self._log.is_whole

    @property
    def dropped(self) -> int:
        """Number of calls and messages that the recorder dropped."""
        return int(self._log.notes.get("dropped", 0))

    @property
    def versions(self) -> Mapping[str, str]:
        """Versions of the packages that ran, by name."""
        versions: dict[str, str] = json.loads(self._log.attachments.get(VERSIONS_ATTACHMENT, b"{}"))
        return versions

    @property
    def span_s(self) -> tuple[float, float] | None:
        """First and last time, seconds; None if the recording has no message."""
        span = self._log.span_ns
        return None if span is None else (1e-9 * span[0], 1e-9 * span[1])

    def calls(self, from_s: float | None = None, to_s: float | None = None) -> Iterator[Call]:
        """Yield the calls between two times, both included, in the order of the run.

        Raises
        ------
        FileError
            If a part of the file is damaged.
        """
        image: Logged | None = None
        for logged in self._messages(from_s, to_s):
            if logged.type_name in IMAGE_TYPES:
                image = logged
            elif logged.type_name == CALL:
                yield self._call(logged, image)
                image = None

    def call_times(self, from_s: float | None = None, to_s: float | None = None) -> Iterator[float]:
        """Yield the times of the calls between two times, both included, in the order of the run; raises as `calls`."""
        return (1e-9 * logged.time_ns for logged in self._messages(from_s, to_s) if logged.type_name == CALL)

    def frames(self, from_s: float | None = None, to_s: float | None = None) -> Iterator[RecordedFrame]:
        """Yield the frames between two times, both included, with the motion between them; raises as `calls`.

        Odometry that the loop received without a frame is included in the odometry of the next frame.
        """
        pending: Pose2 | None = None
        for call in self.calls(from_s, to_s):
            step = self._kind.frame_step(call.kind, call.inputs)
            if step.odometry is not None:
                pending = step.odometry if pending is None else pending.compose(step.odometry)
            if call.frame is None or not step.looks:
                continue
            t_s = call.t_s if step.t_s is None else step.t_s
            yield RecordedFrame(t_s, call.frame, pending, step.prior, step.mounting)
            pending = None

    def truth(self) -> list[tuple[float, Pose2]]:
        """Return the times and true poses of the robot; empty if unknown. Poses that are not finite are skipped."""
        found = []
        for logged in self._log.messages():
            if logged.topic.endswith(_TRUTH):
                with suppress(PacketError):
                    found.append((1e-9 * logged.time_ns, pose_of(decode(logged.data, logged.type_name).pose)))
        return found

    def commands(self) -> list[tuple[float, tuple[float, float, float]]]:
        """Return the commanded velocities with their times, robot frame: forward and left in m/s, turn in rad/s."""
        found = []
        for logged in self._log.messages():
            if logged.topic.endswith(_COMMAND):
                twist = decode(logged.data, logged.type_name).twist
                found.append((1e-9 * logged.time_ns, (twist.linear.x, twist.linear.y, twist.angular.z)))
        return found

    def messages(self, from_s: float | None = None, to_s: float | None = None) -> Iterator[tuple[str, float, Any]]:
        """Yield topic, time and message of all messages, in the order in which they were written; raises as `calls`."""
        for logged in self._messages(from_s, to_s):
            yield logged.topic, 1e-9 * logged.time_ns, decode(logged.data, logged.type_name)

    def _messages(self, from_s: float | None, to_s: float | None) -> Iterator[Logged]:
        from_ns, to_ns = (None if t_s is None else to_nanoseconds(t_s) for t_s in (from_s, to_s))
        return self._log.messages(from_ns, to_ns)

    def _call(self, logged: Logged, image: Logged | None) -> Call:
        try:
            message = decode(logged.data, logged.type_name)
            inputs, outputs = (self._codec.unpack(part.tobytes()) for part in (message.inputs, message.outputs))
            frame = None if image is None else frame_of(decode(image.data, image.type_name))
        except PacketError as error:
            at = 1e-9 * logged.time_ns
            raise FileError(self.path, f"the call at {at:.3f} s cannot be read ({error})") from None
        return Call(int(message.number), str(message.kind), 1e-9 * logged.time_ns, inputs, outputs, frame)
