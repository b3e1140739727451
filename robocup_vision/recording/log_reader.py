"""Reads an MCAP file part by part; a truncated one up to its last complete chunk, or message outside of chunks.

The file's index is not used, since other programs may omit it.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any, NamedTuple

from field_models.errors import FileError
from robocup_vision.messages.types import require_ros_extra

_MAGIC = b"\x89MCAP0\r\n"
# layouts: a record's opcode and length; a chunk's first and last time; a message's channel, number and times
_RECORD = struct.Struct("<BQ")
_CHUNK_TIMES = struct.Struct("<QQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_CHUNK, _ATTACHMENT, _METADATA, _DATA_END, _FOOTER = 0x06, 0x09, 0x0C, 0x0F, 0x02
_SCHEMA, _CHANNEL, _MESSAGE = 0x03, 0x04, 0x05
_CDR = "cdr"


class Logged(NamedTuple):
    """One encoded message of a file: topic, name of its type, time in nanoseconds, and CDR bytes."""

    topic: str
    type_name: str
    time_ns: int
    data: bytes


class _Place(NamedTuple):
    """Position and time span of a chunk, or of a message outside of chunks."""

    offset: int
    length: int
    first_ns: int
    last_ns: int
    is_chunk: bool


class LogReader:
    """Reads the messages of an MCAP file in the order in which they were written.

    Attributes
    ----------
    attachments : dict of str to bytes
        Contents by name.
    notes : dict of str to str
        Metadata that the writer added when it closed the file; empty for a truncated file.
    is_whole : bool
        Whether the writer closed the file; False: it is truncated.

    Raises
    ------
    FileError
        If the file cannot be read, or is not an MCAP file.
    RobocupVisionError
        If the extra `ros` is not installed.
    """

    def __init__(self, path: str | Path) -> None:
        require_ros_extra()
        self.path = Path(path)
        self.attachments: dict[str, bytes] = {}
        self.notes: dict[str, str] = {}
        self.is_whole = False
        self._places: list[_Place] = []
        # from the summary at the end, which a truncated file does not have
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, tuple[str, str]] = {}
        self._has_end = False
        try:
            with self.path.open("rb") as stream:
                self._scan(stream)
        except OSError as error:
            raise FileError(path, f"cannot be read ({error.strerror or error})") from None

    @property
    def topics(self) -> dict[str, str]:
        """Names of the messages' types by topic; an encoding other than CDR is appended to the name."""
        if self._has_end and self._channels:
            return dict(self._channels.values())
        # without a summary, only the chunks contain the channels
        return {logged.topic: logged.type_name for logged in self.messages(on_damage=lambda problem: None)}

    @property
    def span_ns(self) -> tuple[int, int] | None:
        """First and last time of the messages; None if there are none."""
        if not self._places:
            return None
        return min(place.first_ns for place in self._places), max(place.last_ns for place in self._places)

    def messages(
        self, from_ns: int | None = None, to_ns: int | None = None, on_damage: Callable[[str], None] | None = None
    ) -> Iterator[Logged]:
        """Yield the messages between two times, both included, in the order in which they were written.

        `on_damage` is called with the problem of each unreadable chunk, which is then skipped; without it a FileError
        is raised.
        """
        from mcap.records import Channel, Message, Schema

        schemas, channels = dict(self._schemas), dict(self._channels)
        is_known = bool(channels)
        with self.path.open("rb") as stream:
            for place in self._places:
                is_outside = (to_ns is not None and place.first_ns > to_ns) or (
                    from_ns is not None and place.last_ns < from_ns
                )
                # without a summary, no chunk may be skipped, since each may define channels of later ones
                if is_outside and is_known:
                    continue
                try:
                    records = self._records(stream, place)
                except Exception as error:  # zstandard, lz4 and struct each raise their own
                    problem = f"its chunk at {1e-9 * place.first_ns:.3f} s cannot be read ({error})"
                    if on_damage is None:
                        raise FileError(self.path, f"is damaged: {problem}") from None
                    on_damage(problem)
                    continue
                for record in records:
                    if isinstance(record, Schema):
                        schemas[record.id] = record.name
                    elif isinstance(record, Channel):
                        channels[record.id] = (record.topic, _type_name(record, schemas))
                    elif isinstance(record, Message) and record.channel_id in channels:
                        time_ns = record.log_time
                        if (from_ns is None or time_ns >= from_ns) and (to_ns is None or time_ns <= to_ns):
                            yield Logged(*channels[record.channel_id], time_ns, record.data)

    def _records(self, stream: IO[bytes], place: _Place) -> list[Any]:
        from mcap.data_stream import ReadDataStream
        from mcap.records import Chunk, Message
        from mcap.stream_reader import breakup_chunk

        stream.seek(place.offset)
        if not place.is_chunk:
            return [Message.read(ReadDataStream(stream), place.length)]
        return list(breakup_chunk(Chunk.read(ReadDataStream(stream)), validate_crc=True))

    def _scan(self, stream: IO[bytes]) -> None:
        """Find chunks and messages by the headers of records, without reading their content."""
        if stream.read(len(_MAGIC)) != _MAGIC:
            raise FileError(self.path, "is not an MCAP file")
        size = self.path.stat().st_size
        while not self._has_end:
            head = stream.read(_RECORD.size)
            if len(head) < _RECORD.size:
                break
            opcode, length = _RECORD.unpack(head)
            offset = stream.tell()
            if offset + length > size:
                break
            try:
                self._take_record(stream, opcode, offset, length)
            except OSError:
                raise
            except Exception:  # the record is damaged, so that the rest of the file cannot be interpreted
                break
            stream.seek(offset + length)

    def _take_record(self, stream: IO[bytes], opcode: int, offset: int, length: int) -> None:
        from mcap.data_stream import ReadDataStream
        from mcap.records import Attachment, Channel, Metadata, Schema

        data = ReadDataStream(stream)
        if opcode == _CHUNK:
            first_ns, last_ns = _CHUNK_TIMES.unpack(stream.read(_CHUNK_TIMES.size))
            self._places.append(_Place(offset, length, first_ns, last_ns, is_chunk=True))
        elif opcode == _MESSAGE:
            _, _, time_ns, _ = _MESSAGE_HEAD.unpack(stream.read(_MESSAGE_HEAD.size))
            self._places.append(_Place(offset, length, time_ns, time_ns, is_chunk=False))
        elif opcode == _ATTACHMENT:
            attachment = Attachment.read(data)
            self.attachments[attachment.name] = attachment.data
        elif opcode == _METADATA:
            self.notes.update(Metadata.read(data).metadata)
        elif opcode == _SCHEMA:
            schema = Schema.read(data)
            self._schemas[schema.id] = schema.name
        elif opcode == _CHANNEL:
            channel = Channel.read(data)
            self._channels[channel.id] = (channel.topic, _type_name(channel, self._schemas))
        elif opcode == _DATA_END:
            self.is_whole = True
        elif opcode == _FOOTER:
            self._has_end = True


def _type_name(channel: Any, schemas: dict[int, str]) -> str:
    name = schemas.get(channel.schema_id, "")
    return name if channel.message_encoding == _CDR else f"{name} ({channel.message_encoding})".strip()
