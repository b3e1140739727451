"""Any rosbag2 folder, .mcap or .db3 file: its topics and their messages, raw or compressed, read by rosbags."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from field_models.errors import FileError, PacketError, RobocupVisionError
from robocup_vision.messages.types import decode, require_ros_extra, typestore
from robocup_vision.recording.log_reader import LogReader

_SUFFIXES = (".mcap", ".db3")


def is_bag(path: str | Path) -> bool:
    """Whether a path is a recording or a bag, as far as its name tells."""
    path = Path(path)
    return path.suffix in _SUFFIXES or (path / "metadata.yaml").is_file()


class Bag:
    """A bag, opened as often as it is read.

    Parameters
    ----------
    path : str or Path
        A rosbag2 folder, or a .mcap or .db3 file. A .mcap that was cut off is read up to its last whole chunk.

    Raises
    ------
    FileError
        If it cannot be read.
    RobocupVisionError
        If the extra `ros` is not installed.
    """

    def __init__(self, path: str | Path) -> None:
        require_ros_extra()
        self.path = Path(path)
        self._cut: LogReader | None = None
        if not self.path.exists():
            raise FileError(path, "does not exist")
        if self.path.suffix == ".mcap" and not (reader := LogReader(self.path)).is_whole:
            self._cut = reader
            self.topics: Mapping[str, str] = {message.topic: message.type_name for message in reader.messages()}
            return
        with self._reader() as bag:
            self.topics = {connection.topic: connection.msgtype for connection in bag.connections}

    @property
    def is_whole(self) -> bool:
        """Whether it was closed properly."""
        return self._cut is None

    def messages(self, topic: str) -> Iterator[tuple[float, Any]]:
        """Yield time, seconds, and message of a topic, in the order of the file; a message that is none is its error.

        Raises
        ------
        FileError
            If the bag is damaged.
        """
        if self._cut is not None:
            for logged in self._cut.messages():
                if logged.topic == topic:
                    yield (
                        1e-9 * logged.time_ns,
                        _decoded(lambda data, name: decode(data, name), logged.data, logged.type_name),
                    )
            return
        with self._reader() as bag:
            connections = [connection for connection in bag.connections if connection.topic == topic]
            if not connections:
                return
            try:
                for connection, time_ns, data in bag.messages(connections):
                    yield 1e-9 * time_ns, _decoded(bag.deserialize, data, connection.msgtype)
            except (GeneratorExit, RobocupVisionError):
                raise
            except Exception as error:  # sqlite, zstandard and rosbags each raise their own
                raise FileError(self.path, f"is damaged ({_one_line(error)})") from None

    def _reader(self) -> Any:
        from rosbags.highlevel import AnyReader

        try:
            reader = AnyReader([self.path], default_typestore=typestore())
            return _Opened(reader, self.path)
        except Exception as error:
            raise FileError(self.path, f"is no bag that can be read ({_one_line(error)})") from None


class _Opened:
    """Opens a reader; what it says of a bad bag becomes our error."""

    def __init__(self, reader: Any, path: Path) -> None:
        self._reader, self._path = reader, path

    def __enter__(self) -> Any:
        try:
            self._reader.open()
        except Exception as error:
            raise FileError(self._path, f"is no bag that can be read ({_one_line(error)})") from None
        return self._reader

    def __exit__(self, *_: object) -> None:
        self._reader.close()


def _decoded(read: Any, data: Any, name: str) -> Any:
    try:
        return read(data, name)
    except Exception as error:  # rosbags raises errors of several kinds
        return PacketError(f"a message is no {name} ({_one_line(error)})")


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
