"""Records a robot's run while it runs: frames and messages for people, exact calls for the replay.

The loop's own time goes into handing over references, and a copy of the frame; a thread makes and writes messages.
"""

from __future__ import annotations

import json
import platform
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal, cast

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray, Frame, UInt8Array
from robocup_vision.avoidance.steering import FreeRanges, Steering, SteeringCommand
from robocup_vision.camera.files import save_camera
from robocup_vision.camera.pinhole import Mounting
from robocup_vision.checks import require_at_least
from robocup_vision.closing import Closing
from robocup_vision.disc import Disc
from robocup_vision.estimates import PoseEstimate
from robocup_vision.files.value_codec import ValueCodec
from robocup_vision.geometry import Pose2
from robocup_vision.messages.images import IMAGE_FORMATS, ImageFormat
from robocup_vision.messages.topics import TOPIC_TYPES, Outgoing, Topics, TopicSettings
from robocup_vision.messages.types import CALL, header, make, prepare
from robocup_vision.perception.color_table import save_colors
from robocup_vision.perception.free_space import FreeSpace
from robocup_vision.pipeline.frames import to_bgr
from robocup_vision.recording.calls import DROPPED, FORGET, LOOK, PREDICT, STEER, look_outputs, steer_outputs
from robocup_vision.recording.log_writer import COMPRESSIONS, Compression, Job, LogWriter
from robocup_vision.recording.run import Run
from robocup_vision.recording.values import value_codec
from robocup_vision.view import View
from robocup_vision.vision import Vision

CALL_TOPIC = "/robocup_vision/calls"
RUN_ATTACHMENT, VERSIONS_ATTACHMENT = "run.json", "versions.json"
# that results may depend on
_PACKAGES = ("robocup-vision", "numpy", "numba", "opencv-python-headless")


@dataclass(frozen=True, slots=True)
class RecorderSettings:
    """How a run is recorded.

    Parameters
    ----------
    image_format : {"raw", "png", "jpeg"}
        "raw" and "png" replay bit for bit; "jpeg" is a tenth as large, and a replay sees other pixels than the run did.
    compression : {"lz4", "zstd", "none"}
        Of the file's chunks; "zstd" makes it smaller by a tenth and takes five times as long, in the thread.
    max_waiting_bytes : int
        Of what waits to be written.
    when_full : {"wait", "drop"}
        Beyond that the loop waits for the disk, or frames are left out, counted and noted: then it cannot be replayed
        bit for bit.
    prefix : str
        Before every topic's name.
    markings : bool
        Whether each frame's markings are kept, too: the thread takes longer to find them than a look takes.

    Raises
    ------
    ArgumentError
        A value is out of its range.
    """

    image_format: ImageFormat = "raw"
    compression: Compression = "lz4"
    max_waiting_bytes: int = 256 << 20
    when_full: Literal["wait", "drop"] = "wait"
    prefix: str = ""
    markings: bool = False

    def __post_init__(self) -> None:
        if self.image_format not in IMAGE_FORMATS:
            raise ArgumentError(f"image_format must be one of {', '.join(IMAGE_FORMATS)}, got {self.image_format!r}")
        if self.compression not in COMPRESSIONS:
            raise ArgumentError(f"compression must be one of {', '.join(COMPRESSIONS)}, got {self.compression!r}")
        if self.when_full not in ("wait", "drop"):
            raise ArgumentError(f"when_full must be 'wait' or 'drop', got {self.when_full!r}")
        require_at_least(self, 1, "max_waiting_bytes")


class CallWriter(Closing):
    """Writes the calls of a run of any loop, and messages beside them, to a recording.

    Parameters
    ----------
    path : str or Path
        The file, ``.mcap``; one that is there is replaced.
    types : mapping of str to str, optional
        Further classes of values in the calls: class name to module.

    Raises
    ------
    FileError
        If the file cannot be written.
    RobocupVisionError
        If the extra `ros` is not installed.
    """

    def __init__(
        self,
        path: str | Path,
        run: Run,
        settings: RecorderSettings = RecorderSettings(),
        types: Mapping[str, str] | None = None,
    ) -> None:
        self._settings = settings
        self._codec = value_codec(types)
        prepare([CALL, *TOPIC_TYPES.values()])
        what = TopicSettings(settings.prefix, image_format=settings.image_format, markings=settings.markings)
        self.topics = Topics(run.field, run.camera, what)
        self._log = LogWriter(
            path,
            _attachments(run, self._codec),
            f"robocup-vision {_version('robocup-vision')}",
            settings.compression,
            settings.max_waiting_bytes,
            settings.when_full,
        )
        self.path = self._log.path
        self._number = 0
        self._begin_s = time.monotonic()

    @property
    def clock_s(self) -> float:
        """Seconds since the recording began: the time of calls that have none of their own."""
        return time.monotonic() - self._begin_s

    @property
    def dropped(self) -> int:
        """How many calls were left out, with `when_full` "drop"."""
        return self._log.dropped

    @property
    def in_call(self) -> AbstractContextManager[None]:
        """While it is entered, the robot's loop is at work, and the writer's thread waits: see `LogWriter.in_call`."""
        return self._log.in_call()

    def add_call(
        self,
        kind: str,
        t_s: float,
        inputs: Mapping[str, Any],
        make_outputs: Callable[[], Mapping[str, Any]],
        make_messages: Job,
        size_bytes: int = 0,
    ) -> None:
        """Write a call.

        Parameters
        ----------
        inputs : mapping
            What it took, but for the frame; must not change any more.
        make_outputs : callable
            Returns what it gave; called in the writer's thread.
        make_messages : callable
            Returns the messages that go before the call; likewise.
        size_bytes : int
            About what it holds in memory.
        """
        number, self._number = self._number, self._number + 1

        def job() -> Iterator[Outgoing]:
            yield from make_messages()
            packed = [np.frombuffer(self._codec.pack(value), dtype=np.uint8) for value in (inputs, make_outputs())]
            call = make(CALL, header(t_s, ""), number, kind, *packed)
            yield Outgoing(self._settings.prefix + CALL_TOPIC, call, t_s)

        self._log.add(job, size_bytes)

    def add_messages(self, make_messages: Job) -> None:
        """Write messages that are no call's, such as truth; they are made in the writer's thread."""
        self._log.add(make_messages)

    def close(self) -> None:
        """Write what waits, and close the file.

        Raises
        ------
        RobocupVisionError
            If something could not be written: the file ends before it.
        """
        self._log.close({"calls": str(self._number), "dropped": str(self._log.dropped)})


class Recorder(Closing):
    """Records what a `Vision` and a `Steering` take and give.

    Call `look`, `predict`, `steer` and `forget` of this object instead of theirs; or call theirs, and hand over what
    went in and came out (`add_look`). Begin before the first frame, or after `forget`: then `robocup-vision replay`
    makes the same run again, bit for bit.

    Parameters
    ----------
    path : str or Path
        The file, ``.mcap``; one that is there is replaced.
    steering : Steering, optional
        What steers.

    Raises
    ------
    FileError
        If the file cannot be written.
    RobocupVisionError
        If the extra `ros` is not installed.

    Examples
    --------
    >>> with Recorder("run.mcap", vision, steering) as recorder:  # doctest: +SKIP
    ...     view = recorder.look(frame, t_s=t_s, odometry=odometry)
    ...     command = recorder.steer(view.free_space, velocity_mps, target_bearing_rad)
    """

    def __init__(
        self,
        path: str | Path,
        vision: Vision,
        steering: Steering | None = None,
        settings: RecorderSettings = RecorderSettings(),
    ) -> None:
        self._vision, self._steering = vision, steering
        self._calls = CallWriter(path, Run.of(vision, steering), settings)
        self.path = self._calls.path
        self._view: View | None = None
        self._t_s: float | None = None

    @property
    def dropped(self) -> int:
        """How many calls were left out, with `when_full` "drop"."""
        return self._calls.dropped

    def look(
        self,
        frame: Frame | None,
        t_s: float | None = None,
        odometry: Pose2 | None = None,
        prior: PoseEstimate | Pose2 | None = None,
        pan_rad: float | None = None,
        mounting: Mounting | None = None,
    ) -> View:
        """Look, and record it: `Vision.look`."""
        with self._calls.in_call:
            view = self._vision.look(frame, t_s, odometry, prior, pan_rad, mounting)
            self.add_look(view, frame, t_s, odometry, prior, pan_rad, mounting)
        return view

    def add_look(
        self,
        view: View,
        frame: Frame | None,
        t_s: float | None = None,
        odometry: Pose2 | None = None,
        prior: PoseEstimate | Pose2 | None = None,
        pan_rad: float | None = None,
        mounting: Mounting | None = None,
    ) -> None:
        """Record a look that has been made: the view, and what `Vision.look` was called with."""
        self._view = view
        at_s = self._at(t_s)
        inputs: dict[str, Any] = {"t_s": t_s, "odometry": odometry, "prior": prior, "pan_rad": pan_rad}
        if mounting is not None:
            inputs["mounting"] = mounting
        # recordings hold BGR, whatever the camera gives
        kept = None if frame is None else own_frame(to_bgr(cast("UInt8Array", frame), self._vision.channels))
        if kept is None:
            inputs[DROPPED] = True
        topics = self._calls.topics
        # the writer looks for markings when the caller may have gone on with another frame
        shown = view if kept is None else view.of_frame(kept)

        def messages() -> Iterator[Outgoing]:
            if odometry is not None:
                yield from topics.of_odometry(odometry, at_s)
            if kept is not None:
                yield from topics.of_frame(kept, at_s)
            yield from topics.of_look(shown, at_s)

        size_bytes = 0 if kept is None else kept.nbytes
        self._calls.add_call(LOOK, at_s, inputs, lambda: look_outputs(view), messages, size_bytes)

    def predict(self, odometry: Pose2, t_s: float) -> None:
        """Move what memory believes, and record it: `Vision.predict`."""
        self._vision.predict(odometry, t_s)
        self._t_s = t_s
        topics = self._calls.topics
        inputs = {"odometry": odometry, "t_s": t_s}
        self._calls.add_call(PREDICT, t_s, inputs, dict, lambda: topics.of_odometry(odometry, t_s))

    def steer(
        self,
        free_space: FreeRanges,
        velocity_mps: Sequence[float] | FloatArray,
        target_bearing_rad: float,
        target_distance_m: float | None = None,
        pending_mps: Sequence[float] | FloatArray | None = None,
        moving: Sequence[Disc] = (),
        speed_mps: float | None = None,
    ) -> SteeringCommand:
        """Steer, and record it: `Steering.steer`.

        Raises
        ------
        ArgumentError
            If the recorder was made without a `Steering`.
        """
        if self._steering is None:
            raise ArgumentError("steer needs a Steering: Recorder(path, vision, steering)")
        moving = tuple(moving)
        with self._calls.in_call:
            command = self._steering.steer(
                free_space, velocity_mps, target_bearing_rad, target_distance_m, pending_mps, moving, speed_mps
            )
        # of the view itself: a replay with other settings then steers by what that one shows
        of_view = self._view is not None and free_space is self._view.free_space
        inputs = {
            "free_space": None
            if of_view
            else FreeSpace(np.array(free_space.bearing_rad), np.array(free_space.range_m)),
            "velocity_mps": tuple(float(v) for v in velocity_mps),
            "target_bearing_rad": float(target_bearing_rad),
            "target_distance_m": target_distance_m,
            "pending_mps": None if pending_mps is None else tuple(float(v) for v in pending_mps),
            "moving": moving,
            "speed_mps": speed_mps,
        }
        at_s = self._calls.clock_s if self._t_s is None else self._t_s
        topics = self._calls.topics
        self._calls.add_call(
            STEER, at_s, inputs, lambda: steer_outputs(command), lambda: topics.of_command(command, at_s)
        )
        return command

    def forget(self) -> None:
        """Make `Vision` and `Steering` forget, and record it."""
        self._vision.forget()
        if self._steering is not None:
            self._steering.forget()
        self.add_forget()

    def add_forget(self) -> None:
        """Record that `Vision` and `Steering` have been made to forget."""
        at_s = self._calls.clock_s if self._t_s is None else self._t_s
        self._calls.add_call(FORGET, at_s, {}, dict, list)

    def add_truth(self, robot: Pose2, t_s: float, ball_m: tuple[float, float] | None = None) -> None:
        """Record where the robot, and the ball, truly were: topics of their own, which no replay reads."""
        topics = self._calls.topics
        self._calls.add_messages(lambda: topics.of_truth(robot, t_s, ball_m))

    def close(self) -> None:
        """Write what waits, and close the file; raises as `CallWriter.close`."""
        self._calls.close()

    def _at(self, t_s: float | None) -> float:
        if t_s is None:
            return self._calls.clock_s
        self._t_s = t_s
        return t_s


def own_frame(frame: UInt8Array) -> UInt8Array:
    """Return a frame, or a copy of it where somebody else may write to it."""
    if frame.base is None and not frame.flags.writeable:
        return frame
    return np.array(frame)


def _attachments(run: Run, codec: ValueCodec) -> list[tuple[str, str, bytes]]:
    """Return what a recording carries with it: the run, exactly; camera and colours as their own files; versions."""
    files = [(RUN_ATTACHMENT, "application/json", codec.to_json(run))]
    with TemporaryDirectory() as folder:
        camera, colors = Path(folder) / "camera.toml", Path(folder) / "colors.toml"
        save_camera(run.camera, camera)
        files.append((camera.name, "application/toml", camera.read_bytes()))
        if run.colors is not None:
            save_colors(run.colors, colors)
            files.append((colors.name, "application/toml", colors.read_bytes()))
    field = {"name": run.field.name, "source": run.field.source}
    files.append(("field.json", "application/json", json.dumps(field, indent=1).encode()))
    versions = {name: _version(name) for name in _PACKAGES}
    versions |= {"python": platform.python_version(), "machine": platform.machine()}
    files.append((VERSIONS_ATTACHMENT, "application/json", json.dumps(versions, indent=1).encode()))
    return files


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
