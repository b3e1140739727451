"""Writes the calls of a run and its messages to an MCAP file, in a thread of its own.

The robot's loop only hands over values. The thread encodes, compresses and writes them, in chunks of less than a
second. A truncated file can be read up to its last complete chunk.
"""

from __future__ import annotations

import json
import platform
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

import numpy as np

from field_models.errors import ArgumentError, FileError, RobocupVisionError
from robocup_vision.camera.files import save_camera
from robocup_vision.checks import require_at_least
from robocup_vision.closing import Closing
from robocup_vision.files.output_folder import telling_write_errors
from robocup_vision.files.value_codec import ValueCodec
from robocup_vision.messages.images import IMAGE_FORMATS, ImageFormat
from robocup_vision.messages.topics import TOPIC_TYPES, Outgoing, Topics, TopicSettings
from robocup_vision.messages.types import (
    CALL,
    definition,
    encode,
    header,
    make,
    prepare,
    require_ros_extra,
    to_nanoseconds,
    type_hash,
)
from robocup_vision.perception.color_table import save_colors
from robocup_vision.recording.run import Run
from robocup_vision.recording.values import value_codec

Compression = Literal["lz4", "zstd", "none"]
COMPRESSIONS: tuple[Compression, ...] = ("lz4", "zstd", "none")
CALL_TOPIC = "/robocup_vision/calls"
RUN_ATTACHMENT, VERSIONS_ATTACHMENT = "run.json", "versions.json"
# packages on whose version results may depend
_PACKAGES = ("robocup-vision", "numpy", "numba", "opencv-python-headless")
# largest age and size of a chunk: a crash loses at most one, and a reader holds one in memory
_CHUNK_S, _CHUNK_BYTES = 0.5, 1 << 20
# The loop counts as idle this long after its last call. Jobs that have waited for the second time are written anyway.
_REST_S, _MAX_WAIT_S = 0.002, 0.25

Job = Callable[[], Iterable[Outgoing]]


@dataclass(frozen=True, slots=True)
class RecorderSettings:
    """How a run is recorded.

    Parameters
    ----------
    image_format : {"raw", "png", "jpeg"}
        "raw" and "png" replay bit for bit; "jpeg" is a tenth as large, but a replay sees other pixels than the run did.
    compression : {"lz4", "zstd", "none"}
        Compression of the file's chunks; "zstd" makes the file smaller by a tenth, and takes five times as long.
    max_waiting_bytes : int
        Largest size of all jobs that wait to be written.
    when_full : {"wait", "drop"}
        Beyond that size the loop waits for the disk, or calls are dropped and counted: then a replay is not exact.
    prefix : str
        Precedes every topic's name.
    markings : bool
        Whether each frame's markings are recorded. Finding them takes the thread longer than a look takes.

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
    """Writes calls, and messages beside them, in the order in which the robot's loop hands them over.

    An existing file is replaced. `types` names further classes of values in the calls: class name to module.

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
        require_ros_extra()
        from mcap.writer import CompressionType, Writer

        self._settings = settings
        self._codec = value_codec(types)
        prepare([CALL, *TOPIC_TYPES.values()])
        what = TopicSettings(settings.prefix, image_format=settings.image_format, markings=settings.markings)
        self.topics = Topics(run.field, run.camera, what)
        self.path = Path(path)
        with telling_write_errors(path):
            self._stream = self.path.open("wb")
        kind = CompressionType[settings.compression.upper()]
        self._writer: Any = Writer(self._stream, chunk_size=_CHUNK_BYTES, compression=kind)
        self._writer.start(profile="ros2", library=f"robocup-vision {_version('robocup-vision')}")
        # first, so that a truncated file has them
        for name, media_type, data in _attachments(run, self._codec):
            now = time.time_ns()
            self._writer.add_attachment(now, now, name, media_type, data)
        self._channels: dict[str, tuple[int, str]] = {}
        self._schemas: dict[str, int] = {}
        self._jobs: deque[tuple[int, float, Job]] = deque()
        self._calls_now, self._rest_from_s = 0, 0.0
        self._waiting_bytes, self._dropped, self._messages, self._number = 0, 0, 0, 0
        self._changed = threading.Condition()
        self._is_closing = False
        self._problem: RobocupVisionError | None = None
        self._begin_s = self._chunk_since_s = time.monotonic()
        self._thread = threading.Thread(target=self._run, name=f"recording {self.path.name}", daemon=True)
        self._thread.start()

    @property
    def clock_s(self) -> float:
        """Seconds since the recording began: the time of calls that have no time of their own."""
        return time.monotonic() - self._begin_s

    @property
    def dropped(self) -> int:
        """Number of calls and messages dropped, with `when_full` "drop"."""
        return self._dropped

    def add_call(
        self,
        kind: str,
        t_s: float,
        inputs: Mapping[str, Any],
        make_outputs: Callable[[], Mapping[str, Any]],
        make_messages: Job,
        size_bytes: int = 0,
    ) -> None:
        """Write a call; raises as `add_messages`.

        Parameters
        ----------
        inputs : mapping
            The call's arguments except the frame; they must not change afterwards.
        make_outputs : callable
            Returns the call's results; called in the writer's thread.
        make_messages : callable
            Returns the messages that precede the call; called in the writer's thread.
        size_bytes : int
            Approximate memory that the call holds until it is written.
        """
        number, self._number = self._number, self._number + 1

        def job() -> Iterator[Outgoing]:
            yield from make_messages()
            packed = [np.frombuffer(self._codec.pack(value), dtype=np.uint8) for value in (inputs, make_outputs())]
            call = make(CALL, header(t_s, ""), number, kind, *packed)
            yield Outgoing(self._settings.prefix + CALL_TOPIC, call, t_s)

        self.add_messages(job, size_bytes)

    def add_messages(self, job: Job, size_bytes: int = 0) -> None:
        """Write the messages that `job`, called in the writer's thread, returns, such as those of the truth.

        `size_bytes` is the approximate memory of the values that it refers to, which must not change afterwards. Raises
        RobocupVisionError if an earlier message could not be made or written; the file then ends before that message.
        """
        with self._changed:
            if self._problem is not None:
                raise self._problem
            while self._waiting_bytes > self._settings.max_waiting_bytes and self._problem is None:
                if self._settings.when_full == "drop":
                    self._dropped += 1
                    return
                self._changed.wait(1.0)
            self._jobs.append((size_bytes, time.monotonic(), job))
            self._waiting_bytes += size_bytes
            self._changed.notify_all()

    @contextmanager
    def in_call(self) -> Iterator[None]:
        """Mark the robot's loop as busy while the context is entered: the thread waits until it is idle.

        Both threads share one interpreter, so making messages would delay the loop. A job that has waited for a quarter
        of a second is written even while the loop is busy.
        """
        self._calls_now += 1
        try:
            yield
        finally:
            self._calls_now -= 1
            self._rest_from_s = time.monotonic() + _REST_S

    def close(self) -> None:
        """Write the waiting jobs and the file's index, and close the file; raises as `add_messages`."""
        with self._changed:
            if self._is_closing:
                return
            self._is_closing = True
            self._changed.notify_all()
        self._thread.join()
        try:
            if self._problem is None:
                self._writer.flush()
                notes = {"calls": str(self._number), "dropped": str(self._dropped)}
                self._writer.add_metadata("robocup_vision", notes)
                self._writer.finish()
            self._stream.close()
        except OSError as error:
            self._problem = FileError(self.path, f"cannot be written ({error.strerror or error})")
        if self._problem is not None:
            raise self._problem

    def _run(self) -> None:
        while True:
            with self._changed:
                while not self._jobs and not self._is_closing:
                    if not self._changed.wait(_CHUNK_S):
                        break
                if not self._jobs and self._is_closing:
                    return
                size, came_s, job = self._jobs.popleft() if self._jobs else (0, 0.0, None)
            try:
                if job is not None:
                    self._wait_for_rest(came_s)
                    for outgoing in job():
                        self._write(outgoing)
                        self._wait_for_rest(came_s)
                if time.monotonic() - self._chunk_since_s > _CHUNK_S:
                    self._writer.flush()
                    self._chunk_since_s = time.monotonic()
            except OSError as error:
                self._fail(FileError(self.path, f"cannot be written ({error.strerror or error})"))
                return
            except RobocupVisionError as error:
                self._fail(error)
                return
            except Exception as error:  # the loop gets it at its next call; otherwise it would wait for ever
                self._fail(RobocupVisionError(f"{self.path}: internal error: {type(error).__name__}: {error}"))
                return
            with self._changed:
                self._waiting_bytes -= size
                self._changed.notify_all()

    def _wait_for_rest(self, came_s: float) -> None:
        """Wait until the loop is idle, or the job has waited for `_MAX_WAIT_S`."""
        while not self._is_closing:
            now_s = time.monotonic()
            if now_s > came_s + _MAX_WAIT_S or not (self._calls_now or now_s < self._rest_from_s):
                return
            time.sleep(_REST_S / 2)

    def _fail(self, error: RobocupVisionError) -> None:
        with self._changed:
            self._problem = error
            self._jobs.clear()
            self._changed.notify_all()

    def _write(self, outgoing: Outgoing) -> None:
        topic, message, t_s = outgoing
        kind = message.__msgtype__
        if topic not in self._channels:
            self._channels[topic] = (self._register(topic, kind), kind)
        channel, known = self._channels[topic]
        if known != kind:
            raise RobocupVisionError(f"topic {topic} has messages of {known}, one of {kind} cannot be written to it")
        at = max(to_nanoseconds(t_s), 0)
        self._writer.add_message(channel, at, encode(message), at, self._messages & 0xFFFFFFFF)
        self._messages += 1

    def _register(self, topic: str, kind: str) -> int:
        if kind not in self._schemas:
            self._schemas[kind] = self._writer.register_schema(kind, "ros2msg", definition(kind).encode())
        metadata = {"topic_type_hash": type_hash(kind), "offered_qos_profiles": _qos(topic)}
        return int(self._writer.register_channel(topic, "cdr", self._schemas[kind], metadata))


def _qos(topic: str) -> str:
    """Return the quality of service as rosbag2 writes it; topics for late subscribers are transient local."""
    durability = "transient_local" if topic in ("/tf_static", "/map") else "volatile"
    return (
        "- history: keep_last\n  depth: 10\n  reliability: reliable\n"
        f"  durability: {durability}\n  deadline:\n    sec: 9223372036\n    nsec: 854775807\n"
        "  lifespan:\n    sec: 9223372036\n    nsec: 854775807\n  liveliness: automatic\n"
        "  liveliness_lease_duration:\n    sec: 9223372036\n    nsec: 854775807\n"
        "  avoid_ros_namespace_conventions: false\n"
    )


def _attachments(run: Run, codec: ValueCodec) -> list[tuple[str, str, bytes]]:
    """Return name, media type and bytes of each attachment: the run, camera, colours and field, and the versions."""
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
