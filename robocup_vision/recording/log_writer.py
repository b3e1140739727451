"""An MCAP file written by a thread of its own, in chunks of less than a second: a cut file reads up to its last chunk.

The loop only hands over what there is to write: it is encoded, compressed and written by the thread.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

from field_models.errors import FileError, RobocupVisionError
from robocup_vision.files.output_folder import telling_write_errors
from robocup_vision.messages.topics import Outgoing
from robocup_vision.messages.types import definition, encode, require_ros_extra, to_nanoseconds, type_hash

Compression = Literal["lz4", "zstd", "none"]
COMPRESSIONS: tuple[Compression, ...] = ("lz4", "zstd", "none")
# largest age and size of a chunk: what a crash can cost, and what a reader must hold in memory
_CHUNK_S, _CHUNK_BYTES = 0.5, 1 << 20
# the loop is at rest when its last call ended so long ago; what has waited longer than this is written all the same
_REST_S, _MAX_WAIT_S = 0.002, 0.25
_PROFILE = "ros2"


Job = Callable[[], Iterable[Outgoing]]


class LogWriter:
    """Writes messages to an MCAP file, in the order they were handed over.

    Parameters
    ----------
    path : str or Path
        The file; one that is there is replaced.
    attachments : iterable of (str, str, bytes)
        Name, media type and content: written first, so that a cut file has them.
    max_waiting_bytes : int
        Of what waits to be written.
    when_full : {"wait", "drop"}
        What happens beyond that: the loop waits, or what it hands over is dropped, and counted.

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
        attachments: Iterable[tuple[str, str, bytes]],
        library: str,
        compression: Compression = "lz4",
        max_waiting_bytes: int = 256 << 20,
        when_full: Literal["wait", "drop"] = "wait",
    ) -> None:
        require_ros_extra()
        from mcap.writer import CompressionType, Writer

        self.path = Path(path)
        with telling_write_errors(path):
            self._stream = self.path.open("wb")
        kind = CompressionType[compression.upper()]
        self._writer: Any = Writer(self._stream, chunk_size=_CHUNK_BYTES, compression=kind)
        self._writer.start(profile=_PROFILE, library=library)
        for name, media_type, data in attachments:
            now = time.time_ns()
            self._writer.add_attachment(now, now, name, media_type, data)
        self._channels: dict[str, tuple[int, str]] = {}
        self._schemas: dict[str, int] = {}
        self._max_waiting, self._waits = max_waiting_bytes, when_full == "wait"
        self._jobs: deque[tuple[int, float, Job]] = deque()
        self._calls_now, self._rest_from_s = 0, 0.0
        self._waiting_bytes, self._dropped, self._messages = 0, 0, 0
        self._changed = threading.Condition()
        self._is_closing = False
        self._problem: RobocupVisionError | None = None
        self._chunk_since_s = time.monotonic()
        self._thread = threading.Thread(target=self._run, name=f"recording {self.path.name}", daemon=True)
        self._thread.start()

    @property
    def dropped(self) -> int:
        """How often something was dropped because the file could not be written fast enough."""
        return self._dropped

    @property
    def messages(self) -> int:
        """How many messages have been written."""
        return self._messages

    def add(self, job: Job, size_bytes: int = 0) -> bool:
        """Hand over what makes messages; it is called in the thread.

        Parameters
        ----------
        job : callable
            Returns the messages; what it refers to must not change any more.
        size_bytes : int
            About how much memory it holds.

        Returns
        -------
        bool
            False if it was dropped.

        Raises
        ------
        RobocupVisionError
            If an earlier message could not be made or written: the file ends before it.
        """
        with self._changed:
            if self._problem is not None:
                raise self._problem
            while self._waiting_bytes > self._max_waiting and self._problem is None:
                if not self._waits:
                    self._dropped += 1
                    return False
                self._changed.wait(1.0)
            self._jobs.append((size_bytes, time.monotonic(), job))
            self._waiting_bytes += size_bytes
            self._changed.notify_all()
        return True

    @contextmanager
    def in_call(self) -> Iterator[None]:
        """While this is entered, the robot's loop is at work: the thread waits until it rests.

        Two threads share one interpreter: messages made while the loop computes would hold it up. What has waited for a
        quarter of a second is written all the same.
        """
        self._calls_now += 1
        try:
            yield
        finally:
            self._calls_now -= 1
            self._rest_from_s = time.monotonic() + _REST_S

    def close(self, notes: dict[str, str] | None = None) -> None:
        """Write what waits and the file's index, and close it; raises as `add`.

        Parameters
        ----------
        notes : dict of str to str, optional
            What is known at the end alone, as metadata.
        """
        with self._changed:
            if self._is_closing:
                return
            self._is_closing = True
            self._changed.notify_all()
        self._thread.join()
        try:
            if self._problem is None:
                if notes:
                    self._writer.flush()
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
            except Exception as error:  # the loop must learn of it, and not wait for ever
                self._fail(RobocupVisionError(f"{self.path}: internal error: {type(error).__name__}: {error}"))
                return
            with self._changed:
                self._waiting_bytes -= size
                self._changed.notify_all()

    def _wait_for_rest(self, came_s: float) -> None:
        """Wait while the loop is at work, but not for ever."""
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
    """Quality of service as rosbag2 writes it; what stays true for late listeners is transient local."""
    durability = "transient_local" if topic in ("/tf_static", "/map") else "volatile"
    return (
        "- history: keep_last\n  depth: 10\n  reliability: reliable\n"
        f"  durability: {durability}\n  deadline:\n    sec: 9223372036\n    nsec: 854775807\n"
        "  lifespan:\n    sec: 9223372036\n    nsec: 854775807\n  liveliness: automatic\n"
        "  liveliness_lease_duration:\n    sec: 9223372036\n    nsec: 854775807\n"
        "  avoid_ros_namespace_conventions: false\n"
    )
