"""The league's log files: datagrams with their time of reception, read and written one by one.

A file begins with a magic string and a version; then each entry has its time (ns), its kind and its size, all
big-endian. Files whose names end in ``gz`` are compressed. An index, if there is one, is the last entry: the byte
offset of each entry before it, the index's own size, and a mark. Entries that cannot be decoded are counted, and the
number of the first is noted. A file that cannot be written raises `FileError`.
"""

from __future__ import annotations

import gzip
import struct
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path
from typing import BinaryIO, cast

from field_models.errors import ArgumentError, FileError, PacketError
from robocup_vision.closing import Closing
from robocup_vision.ssl.protocol.mapping import decode, encode
from robocup_vision.ssl.values.detection import VisionPacket
from robocup_vision.ssl.values.referee import Referee
from robocup_vision.ssl.values.tracked import TrackerPacket

MAGIC, VERSION = b"SSL_LOG_FILE", 1
INDEX_MARK = b"INDEXED"
# larger sizes mean damage: datagrams have at most 64 kB, and even days of play a smaller index (8 bytes per entry)
MAX_ENTRY_BYTES = 1 << 30
_HEAD = struct.Struct(">qii")
_FILE_HEAD = struct.Struct(">12si")

LogValue = VisionPacket | Referee | TrackerPacket
NS_PER_S = 1e9


class LogKind(IntEnum):
    """The kinds of entries."""

    BLANK = 0
    UNKNOWN = 1
    VISION_2010 = 2
    REFEREE = 3
    VISION = 4
    TRACKER = 5
    INDEX = 6


_VALUES: dict[int, type[VisionPacket] | type[Referee] | type[TrackerPacket]] = {
    LogKind.REFEREE: Referee,
    LogKind.VISION: VisionPacket,
    LogKind.TRACKER: TrackerPacket,
}
_KINDS = {value: LogKind(kind) for kind, value in _VALUES.items()}


@dataclass(frozen=True, slots=True)
class LogEntry:
    """One datagram of a log."""

    received_ns: int  #: when it was received, nanoseconds since 1970
    kind: int  #: a `LogKind`, or a number that later versions of the format may have
    data: bytes  #: as it was received

    @property
    def value(self) -> LogValue | None:
        """The decoded message.

        None for a blank entry, an index, and vision packets of 2010, which have another layout. An entry of kind
        UNKNOWN is decoded as the first of vision, referee and tracker packet that its bytes fit.

        Raises
        ------
        PacketError
            If the bytes are not a message of the entry's kind, or there is no such kind.
        """
        if self.kind in (LogKind.BLANK, LogKind.INDEX, LogKind.VISION_2010):
            return None
        if self.kind == LogKind.UNKNOWN:
            return _guess(self.data)
        if self.kind not in _VALUES:
            raise PacketError(f"there is no log entry of kind {self.kind}")
        return decode(_VALUES[self.kind], self.data)


def log_entry(received_ns: int, value: LogValue) -> LogEntry:
    """Return the entry that holds a value."""
    return LogEntry(received_ns, _KINDS[type(value)], encode(value))


class SslLog(Closing):
    """Reads a log; it can be iterated over several times to get its entries. Close it, or use it in a ``with``.

    Parameters
    ----------
    path : str or Path
        The file; compressed where its name ends in ``gz``.

    Raises
    ------
    FileError
        If the file is unreadable or not a log. Iterating raises it after the last complete entry of a damaged file.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        try:
            self._file: BinaryIO = self.path.open("rb")
            if self.path.name.endswith("gz"):
                self._file = cast(BinaryIO, gzip.GzipFile(fileobj=self._file))
            head = self._file.read(_FILE_HEAD.size)
        except (OSError, EOFError) as error:
            raise FileError(path, f"cannot be read ({_reason(error)})") from None
        if len(head) < _FILE_HEAD.size or head[: len(MAGIC)] != MAGIC:
            self._file.close()
            raise FileError(path, "is no log of the small-size league (it does not begin with SSL_LOG_FILE)")
        version = _FILE_HEAD.unpack(head)[1]
        if version != VERSION:
            self._file.close()
            raise FileError(path, f"must be of version {VERSION}", key="version", value=version)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __iter__(self) -> Iterator[LogEntry]:
        """Yield every entry, including the index if there is one."""
        return (entry for _, entry in self._placed())

    def entry_at(self, place: int) -> LogEntry:
        """Return the entry that begins at byte `place`, one of `places`; raises `FileError` if none does."""
        entry = self._read(place) if place >= _FILE_HEAD.size else None
        if entry is None:
            raise FileError(self.path, f"has no entry at byte {place}")
        return entry

    @property
    def places(self) -> tuple[int, ...]:
        """Byte at which each entry except the index begins (uncompressed), from the index or by reading the file."""
        indexed = None if self.path.name.endswith("gz") else self._read_index()
        if indexed is not None:
            return indexed
        return tuple(place for place, entry in self._placed() if entry.kind != LogKind.INDEX)

    def _placed(self) -> Iterator[tuple[int, LogEntry]]:
        """Yield the byte at which each entry begins, and the entry."""
        place = _FILE_HEAD.size
        while (entry := self._read(place)) is not None:
            yield place, entry
            place += _HEAD.size + len(entry.data)

    def _read_index(self) -> tuple[int, ...] | None:
        tail = struct.Struct(f">q{len(INDEX_MARK)}s")
        size = self._file.seek(0, 2)
        if size < _FILE_HEAD.size + _HEAD.size + tail.size:
            return None
        self._file.seek(size - tail.size)
        back, mark = tail.unpack(self._file.read(tail.size))
        if mark != INDEX_MARK:
            return None
        begin = size - back
        entry = self._read(begin) if _FILE_HEAD.size <= begin < size else None
        if entry is None or entry.kind != LogKind.INDEX or (len(entry.data) - tail.size) % 8:
            raise FileError(self.path, "has a damaged index", key="index", value=back)
        count = (len(entry.data) - tail.size) // 8
        return struct.unpack_from(f">{count}q", entry.data)

    def _read(self, place: int) -> LogEntry | None:
        """Return the entry that begins at byte `place`, or None at the end of the file."""
        try:
            self._file.seek(place)
            head = self._file.read(_HEAD.size)
            if not head:
                return None
            if len(head) < _HEAD.size:
                raise FileError(self.path, f"ends within the head of the entry at byte {place}")
            received_ns, kind, size = _HEAD.unpack(head)
            if not 0 <= size <= MAX_ENTRY_BYTES:
                raise FileError(self.path, f"is damaged at byte {place}: an entry's size", value=size)
            data = self._file.read(size)
        except (OSError, EOFError, zlib.error) as error:
            raise FileError(self.path, f"cannot be read beyond byte {place} ({_reason(error)})") from None
        if len(data) < size:
            raise FileError(self.path, f"ends within the entry at byte {place}: {len(data)} of {size} bytes are there")
        return LogEntry(received_ns, kind, data)


class SslLogWriter(Closing):
    """Writes a log. Close it, or use it in a ``with``: the file is complete only after that.

    Parameters
    ----------
    path : str or Path
        The file; an existing one is replaced. It is compressed if its name ends in ``gz``. The same entries give the
        same bytes.
    index : bool
        Write an index at the end, for tools with random access.
    """

    def __init__(self, path: str | Path, *, index: bool = False) -> None:
        self.path = Path(path)
        self._places: list[int] | None = [] if index else None
        self._place = 0
        try:
            self._plain = self.path.open("wb")
            self._file: BinaryIO = self._plain
            if self.path.name.endswith("gz"):
                # no name and time in the header, so that equal logs are equal bytes
                self._file = cast(BinaryIO, gzip.GzipFile("", "wb", fileobj=self._plain, mtime=0))
        except OSError as error:
            raise FileError(path, f"cannot be written ({_reason(error)})") from None
        self._write(_FILE_HEAD.pack(MAGIC, VERSION))

    def write(self, entry: LogEntry) -> None:
        """Append an entry; raises `ArgumentError` for an index, which the writer makes itself."""
        if entry.kind == LogKind.INDEX:
            raise ArgumentError("an index is not copied: it holds the places of another file (use index=True)")
        if self._places is not None:
            self._places.append(self._place)
        self._write(_HEAD.pack(entry.received_ns, entry.kind, len(entry.data)) + entry.data)

    def close(self) -> None:
        """Write the index, if `index` was set, and close the file."""
        if self._plain.closed:
            return
        if self._places is not None:
            size = 8 * len(self._places) + 8 + len(INDEX_MARK)
            places = struct.pack(f">{len(self._places)}q", *self._places)
            head = _HEAD.pack(0, LogKind.INDEX, size)
            self._write(head + places + struct.pack(">q", _HEAD.size + size) + INDEX_MARK)
        self._file.close()
        self._plain.close()

    def _write(self, data: bytes) -> None:
        try:
            self._file.write(data)
        except OSError as error:
            raise FileError(self.path, f"cannot be written ({_reason(error)})") from None
        self._place += len(data)


def _guess(data: bytes) -> LogValue:
    for kind in (LogKind.VISION, LogKind.REFEREE, LogKind.TRACKER):
        try:
            value = decode(_VALUES[kind], data)
        except PacketError:
            continue
        # a vision packet has only optional fields, so it decodes from many bytes: one without any is rejected
        if not (isinstance(value, VisionPacket) and value.detection is None and value.geometry is None):
            return value
    raise PacketError(f"{len(data)} bytes are neither a vision packet nor a referee's nor a tracker's")


def _reason(error: Exception) -> str:
    return str(getattr(error, "strerror", None) or error)


@dataclass(slots=True)
class Unreadable:
    """The parts of a log that could not be read."""

    count: int = 0  #: number of entries that could not be decoded
    first: str = ""  #: number of the first of them and its error; empty if there is none
    damage: str = ""  #: why the file could not be read to its end; empty if it could


def readable(log: Iterable[LogEntry], unreadable: Unreadable) -> Iterator[tuple[int, LogEntry, LogValue | None]]:
    """Yield the number of each entry in the log, the entry, and its message.

    Where an entry cannot be decoded, the message is None and `unreadable` is updated.
    """
    try:
        for number, entry in enumerate(log):
            value = None
            try:
                value = entry.value
            except PacketError as error:
                unreadable.count += 1
                unreadable.first = unreadable.first or f"entry {number}: {error}"
            yield number, entry, value
    except FileError as error:
        unreadable.damage = str(error)


@dataclass(slots=True)
class LogInfo:
    """A summary of a log."""

    entries: dict[str, int] = field(default_factory=dict)  #: number of entries by the name of their kind
    #: when the first and the last entry except the index were received, nanoseconds since 1970
    first_ns: int | None = None
    last_ns: int | None = None
    cameras: dict[int, int] = field(default_factory=dict)  #: detection frames of each camera
    geometry_packets: int = 0  #: packets with a geometry
    field_m: tuple[float, float] | None = None  #: length and width of the field in the last geometry
    trackers: dict[str, int] = field(default_factory=dict)  #: packets of each tracker, by its name or else its uuid
    #: the referee's commands in their order; one is added whenever the command counter changes
    commands: list[str] = field(default_factory=list)
    teams: tuple[str, str] | None = None  #: names of yellow and blue
    score: tuple[int, int] | None = None  #: goals of yellow and blue in the last referee packet
    unreadable: Unreadable = field(default_factory=Unreadable)  #: what could not be read

    @property
    def duration_s(self) -> float:
        """Time between the first and the last entry."""
        if self.first_ns is None or self.last_ns is None:
            return 0.0
        return (self.last_ns - self.first_ns) / NS_PER_S


def log_info(log: SslLog) -> LogInfo:
    """Read a whole log; the result counts what cannot be read."""
    info = LogInfo()
    counter = None
    for _, entry, value in readable(log, info.unreadable):
        name = LogKind(entry.kind).name.lower() if entry.kind in set(LogKind) else f"kind_{entry.kind}"
        info.entries[name] = info.entries.get(name, 0) + 1
        if entry.kind != LogKind.INDEX:
            info.first_ns = entry.received_ns if info.first_ns is None else info.first_ns
            info.last_ns = entry.received_ns
        if isinstance(value, VisionPacket):
            _add_vision(info, value)
        elif isinstance(value, TrackerPacket):
            tracker = value.source_name or value.uuid
            info.trackers[tracker] = info.trackers.get(tracker, 0) + 1
        elif isinstance(value, Referee):
            if value.command_counter != counter:
                counter = value.command_counter
                info.commands.append(value.command.name)
            info.teams = (value.yellow.name, value.blue.name)
            info.score = (value.yellow.score, value.blue.score)
    return info


def _add_vision(info: LogInfo, packet: VisionPacket) -> None:
    if packet.detection is not None:
        camera = packet.detection.camera_id
        info.cameras[camera] = info.cameras.get(camera, 0) + 1
    if packet.geometry is not None:
        info.geometry_packets += 1
        info.field_m = (packet.geometry.field.length_m, packet.geometry.field.width_m)
