"""Reads recorded bags: a rosbag2 folder, a .mcap or .db3 file, or a ROS 1 .bag; its topics and their messages.

A bag is read from its message files alone: the index, the summary or metadata.yaml may be missing, as after a recorder
was killed. `Bag.notes` says what is missing or could not be read.
"""

from __future__ import annotations

import re
import shutil
import sqlite3
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from field_models.errors import FileError, PacketError, RobocupVisionError
from robocup_vision.files.images import IMAGE_SUFFIXES
from robocup_vision.messages.types import decode, require_ros_extra
from robocup_vision.recording.log_reader import Logged, LogReader

_METADATA = "metadata.yaml"
_PACKED = ".zstd"
_ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"


def is_bag(path: str | Path) -> bool:
    """Whether a path is a recording or a bag, by the names of files only."""
    path = Path(path)
    if not path.is_dir():
        return _kind(path) is not None
    if (path / _METADATA).is_file():
        return True
    # a folder with images, or with a dataset.toml, is a dataset even if it contains recordings
    has_images = any(entry.suffix.lower() in IMAGE_SUFFIXES for entry in path.iterdir())
    return not has_images and not (path / "dataset.toml").is_file() and bool(_message_files(path))


class _Part(ABC):
    """One message file."""

    topics: Mapping[str, str]
    is_whole = True

    @abstractmethod
    def messages(self, topic: str, on_damage: Callable[[str], None]) -> Iterator[Logged]: ...

    def decode(self, message: Logged) -> Any:
        return decode(message.data, message.type_name)


class Bag:
    """A folder of .mcap or .db3 files, such a file, or a ROS 1 .bag. Each reading opens the files again.

    Attributes
    ----------
    topics : mapping of str to str
        Names of the messages' types by topic.
    notes : list of str
        Parts that are missing or could not be read; grows while messages are read.

    Raises
    ------
    FileError
        If the bag cannot be read.
    RobocupVisionError
        If the extra `ros` is not installed.
    """

    def __init__(self, path: str | Path) -> None:
        require_ros_extra()
        self.path = Path(path)
        self.notes: list[str] = []
        self._unpacked: TemporaryDirectory[str] | None = None
        if not self.path.exists():
            raise FileError(path, "does not exist")
        files = self._files() if self.path.is_dir() else [self.path]
        self._parts = [(file, self._open(file)) for file in files]
        self.topics: Mapping[str, str] = {topic: name for _, part in self._parts for topic, name in part.topics.items()}
        for file, part in self._parts:
            if not part.is_whole and not part.topics:
                self._note(f"{file.name}: was cut off before its first whole chunk: nothing of it can be read")
            elif not part.is_whole:
                self._note(f"{file.name}: was cut off: read up to its last whole chunk")
        if not self.topics:
            raise FileError(path, "; ".join(["holds no message that can be read", *self.notes]))

    def messages(self, topic: str) -> Iterator[tuple[float, Any]]:
        """Yield the time, seconds, and each message of a topic, in the order of the file.

        In place of a message that cannot be decoded a `PacketError` is yielded. Raises FileError if the bag is gone.
        """
        for file, part in self._parts:
            try:
                for message in part.messages(topic, partial(self._left_out, file.name)):
                    yield 1e-9 * message.time_ns, _decoded(part, message)
            except (GeneratorExit, RobocupVisionError):
                raise
            except Exception as error:  # sqlite and rosbags each raise their own
                self._left_out(file.name, f"it cannot be read to its end ({_one_line(error)})")

    def _left_out(self, name: str, problem: str) -> None:
        self._note(f"{name}: is damaged: {problem}: left out")

    def _note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)

    def _files(self) -> list[Path]:
        """Return the message files of a folder, in the order of metadata.yaml or, without it, by number."""
        found = _message_files(self.path)
        named = _named_files(self.path / _METADATA)
        if named is None:
            state = "cannot be read" if (self.path / _METADATA).exists() else "is missing"
            if not found:
                raise FileError(self.path, f"holds no .mcap or .db3 file, and its {_METADATA} {state}")
            names = ", ".join(file.name for file in found)
            self._note(f"{self.path.name}: its {_METADATA} {state} (was the recorder killed?): read from {names}")
            return found
        missing = [name for name in named if not (self.path / name).is_file()]
        if missing:
            raise FileError(self.path / _METADATA, "names a file that is not there", value=missing[0])
        others = [file.name for file in found if file.name not in named]
        if others:
            self._note(f"{self.path.name}: its {_METADATA} does not name {', '.join(others)}: left out")
        return [self.path / name for name in named]

    def _open(self, file: Path) -> _Part:
        kind = _kind(file)
        try:
            if file.suffix.lower() == _PACKED:
                file = self._unpack(file)
            if kind == ".mcap":
                return _McapPart(file)
            if kind == ".db3":
                return _SqlitePart(self._with_journal(file))
            if kind == ".bag":
                return _Ros1Part(file)
        except (OSError, RobocupVisionError):
            raise
        except Exception as error:  # sqlite, zstandard and rosbags each raise their own
            raise FileError(file, f"is no bag that can be read ({_one_line(error)})") from None
        raise FileError(file, "is no bag: must be a folder of rosbag2, or a .mcap, .db3 or .bag file")

    def _unpack(self, file: Path) -> Path:
        from zstandard import ZstdDecompressor

        unpacked = self._folder() / file.stem
        with file.open("rb") as packed, unpacked.open("wb") as plain:
            ZstdDecompressor().copy_stream(packed, plain)
        return unpacked

    def _with_journal(self, file: Path) -> Path:
        """Return the database, or a copy with the journal applied if a killed recorder has left one beside it."""
        journals = [file.with_name(file.name + end) for end in ("-wal", "-journal")]
        if not any(journal.is_file() and journal.stat().st_size for journal in journals):
            return file
        copy = self._folder() / file.name
        for source in (file, *journals):
            if source.is_file():
                shutil.copyfile(source, copy.with_name(source.name))
        with closing(sqlite3.connect(copy)) as database:
            database.execute("PRAGMA journal_mode=DELETE").fetchall()
        return copy

    def _folder(self) -> Path:
        if self._unpacked is None:
            self._unpacked = TemporaryDirectory(prefix="robocup_vision-bag-")
        return Path(self._unpacked.name)


class _McapPart(_Part):
    def __init__(self, file: Path) -> None:
        self._reader = LogReader(file)
        self.is_whole = self._reader.is_whole
        self.topics = self._reader.topics

    def messages(self, topic: str, on_damage: Callable[[str], None]) -> Iterator[Logged]:
        return (logged for logged in self._reader.messages(on_damage=on_damage) if logged.topic == topic)


class _SqlitePart(_Part):
    def __init__(self, file: Path) -> None:
        self._file = file
        with closing(self._connect()) as database:
            rows = database.execute("SELECT name, type, serialization_format FROM topics").fetchall()
        self.topics = {name: kind if form == "cdr" else f"{kind} ({form})" for name, kind, form in rows}

    def messages(self, topic: str, on_damage: Callable[[str], None]) -> Iterator[Logged]:
        with closing(self._connect()) as database:
            yield from (
                Logged(*row)
                for row in database.execute(
                    "SELECT name, type, timestamp, data FROM messages JOIN topics ON topics.id = topic_id"
                    " WHERE name = ? ORDER BY timestamp, messages.id",
                    (topic,),
                )
            )

    def _connect(self) -> sqlite3.Connection:
        return sqlite3.connect(f"{self._file.resolve().as_uri()}?mode=ro&immutable=1", uri=True)


class _Ros1Part(_Part):
    def __init__(self, file: Path) -> None:
        from rosbags.typesys import Stores, get_typestore

        self._file, self._types = file, get_typestore(Stores.ROS1_NOETIC)
        with self._reader() as reader:
            self.topics = {connection.topic: connection.msgtype for connection in reader.connections}

    def messages(self, topic: str, on_damage: Callable[[str], None]) -> Iterator[Logged]:
        with self._reader() as reader:
            connections = [connection for connection in reader.connections if connection.topic == topic]
            for connection, time_ns, data in reader.messages(connections) if connections else ():
                yield Logged(topic, connection.msgtype, time_ns, data)

    def decode(self, message: Logged) -> Any:
        return self._types.deserialize_ros1(message.data, message.type_name)

    def _reader(self) -> Any:
        from rosbags.rosbag1 import Reader

        return Reader(self._file)


def _kind(file: Path) -> str | None:
    """Return the suffix that identifies a message file's format; None: it is not a message file."""
    plain = file.with_suffix("") if file.suffix.lower() == _PACKED else file
    # a ROS 1 recorder that was killed leaves .bag.active
    plain = plain.with_suffix("") if plain.suffix.lower() == ".active" else plain
    suffix = plain.suffix.lower()
    return suffix if suffix in (".mcap", ".db3", ".bag") else None


def _message_files(folder: Path) -> list[Path]:
    files = [entry for entry in folder.iterdir() if _kind(entry) in (".mcap", ".db3") and entry.name[0] != "."]
    # bag_2 before bag_10
    return sorted(files, key=lambda file: [(len(word), word) for word in re.split(r"(\d+)", file.name)])


def _named_files(metadata: Path) -> list[str] | None:
    """Return the files that a metadata.yaml names; None if it is missing or cannot be read."""
    from ruamel.yaml import YAML

    try:
        # like rosbag2, look for the files beside metadata.yaml, whatever folder the entries name
        named = YAML(typ="safe").load(metadata.read_text(encoding="utf-8"))["rosbag2_bagfile_information"]
        return [Path(str(entry)).name for entry in named["relative_file_paths"]]
    except Exception:  # a damaged file can cause many kinds of errors
        return None


def _decoded(part: _Part, message: Logged) -> Any:
    try:
        if message.data[:4] == _ZSTD_MAGIC:
            from zstandard import ZstdDecompressor

            message = message._replace(data=ZstdDecompressor().decompressobj().decompress(message.data))
        return part.decode(message)
    except Exception as error:  # rosbags raises errors of several kinds
        return PacketError(f"a message is no {message.type_name} ({_one_line(error)})")


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
