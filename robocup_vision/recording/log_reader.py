"""An MCAP file read chunk by chunk, whole or cut: a cut one ends at its last whole chunk."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, NamedTuple

from field_models.errors import FileError
from robocup_vision.messages.types import require_ros_extra

_MAGIC = b"\x89MCAP0\r\n"
# of a record: opcode and length; of a chunk: first and last time, sizes
_RECORD = struct.Struct("<BQ")
_CHUNK_TIMES = struct.Struct("<QQ")
_CHUNK, _ATTACHMENT, _METADATA, _DATA_END, _FOOTER, _HEADER = 0x06, 0x09, 0x0C, 0x0F, 0x02, 0x01
_SCHEMA, _CHANNEL = 0x03, 0x04


class Logged(NamedTuple):
    """One message as it stands in a file: topic, type's name, time in nanoseconds, and CDR."""

    topic: str
    type_name: str
    time_ns: int
    data: bytes


class _ChunkPlace(NamedTuple):
    offset: int
    length: int
    first_ns: int
    last_ns: int


@dataclass(slots=True)
class _Contents:
    chunks: list[_ChunkPlace] = field(default_factory=list)
    attachments: dict[str, bytes] = field(default_factory=dict)
    notes: dict[str, str] = field(default_factory=dict)
    # of the summary at the end, which a cut file has not
    schemas: dict[int, str] = field(default_factory=dict)
    channels: dict[int, tuple[str, str]] = field(default_factory=dict)
    library: str = ""
    is_whole: bool = False


class LogReader:
    """Reads the messages of an MCAP file in the order they were written.

    Parameters
    ----------
    path : str or Path
        The file.

    Raises
    ------
    FileError
        If it cannot be read, or is no MCAP file.
    RobocupVisionError
        If the extra `ros` is not installed.
    """

    def __init__(self, path: str | Path) -> None:
        require_ros_extra()
        self.path = Path(path)
        try:
            with self.path.open("rb") as stream:
                self._contents = self._scan(stream)
        except OSError as error:
            raise FileError(path, f"cannot be read ({error.strerror or error})") from None

    @property
    def attachments(self) -> dict[str, bytes]:
        """Contents by name."""
        return self._contents.attachments

    @property
    def notes(self) -> dict[str, str]:
        """What its writer noted when it closed the file; empty for a cut file."""
        return self._contents.notes

    @property
    def library(self) -> str:
        """Who wrote it."""
        return self._contents.library

    @property
    def is_whole(self) -> bool:
        """Whether its writer closed it; False: it was cut off."""
        return self._contents.is_whole

    @property
    def span_ns(self) -> tuple[int, int] | None:
        """First and last time of its messages; None where there are none."""
        chunks = self._contents.chunks
        if not chunks:
            return None
        return min(chunk.first_ns for chunk in chunks), max(chunk.last_ns for chunk in chunks)

    def messages(self, from_ns: int | None = None, to_ns: int | None = None) -> Iterator[Logged]:
        """Yield the messages between two times, both included, in the order they were written.

        Raises
        ------
        FileError
            If a chunk is damaged.
        """
        from mcap.records import Channel, Message, Schema
        from mcap.stream_reader import breakup_chunk

        schemas, channels = dict(self._contents.schemas), dict(self._contents.channels)
        is_known = bool(channels)
        with self.path.open("rb") as stream:
            for place in self._contents.chunks:
                is_outside = (to_ns is not None and place.first_ns > to_ns) or (
                    from_ns is not None and place.last_ns < from_ns
                )
                # without a summary, channels are known from the chunks before alone
                if is_outside and is_known:
                    continue
                try:
                    records = breakup_chunk(self._chunk(stream, place), validate_crc=True)
                except Exception as error:  # zstandard, lz4 and struct each raise their own
                    at = 1e-9 * place.first_ns
                    raise FileError(
                        self.path, f"is damaged: its chunk at {at:.3f} s cannot be read ({error})"
                    ) from None
                for record in records:
                    if isinstance(record, Schema):
                        schemas[record.id] = record.name
                    elif isinstance(record, Channel):
                        channels[record.id] = (record.topic, schemas.get(record.schema_id, ""))
                    elif isinstance(record, Message) and record.channel_id in channels:
                        time_ns = record.log_time
                        if (from_ns is None or time_ns >= from_ns) and (to_ns is None or time_ns <= to_ns):
                            yield Logged(*channels[record.channel_id], time_ns, record.data)

    def _chunk(self, stream: IO[bytes], place: _ChunkPlace) -> Any:
        from mcap.data_stream import ReadDataStream
        from mcap.records import Chunk

        stream.seek(place.offset)
        return Chunk.read(ReadDataStream(stream))

    def _scan(self, stream: IO[bytes]) -> _Contents:
        """Find the chunks by their records' headers, without reading what is in them."""
        from mcap.data_stream import ReadDataStream
        from mcap.records import Attachment, Channel, Header, Metadata, Schema

        if stream.read(len(_MAGIC)) != _MAGIC:
            raise FileError(self.path, "is not an MCAP file")
        contents = _Contents()
        size = self.path.stat().st_size
        while True:
            head = stream.read(_RECORD.size)
            if len(head) < _RECORD.size:
                break
            opcode, length = _RECORD.unpack(head)
            offset = stream.tell()
            if offset + length > size:
                break
            if opcode == _CHUNK:
                first_ns, last_ns = _CHUNK_TIMES.unpack(stream.read(_CHUNK_TIMES.size))
                contents.chunks.append(_ChunkPlace(offset, length, first_ns, last_ns))
            elif opcode == _ATTACHMENT:
                attachment = Attachment.read(ReadDataStream(stream))
                contents.attachments[attachment.name] = attachment.data
            elif opcode == _METADATA:
                contents.notes.update(Metadata.read(ReadDataStream(stream)).metadata)
            elif opcode == _HEADER:
                contents.library = Header.read(ReadDataStream(stream)).library
            elif opcode == _SCHEMA:
                schema = Schema.read(ReadDataStream(stream))
                contents.schemas[schema.id] = schema.name
            elif opcode == _CHANNEL:
                channel = Channel.read(ReadDataStream(stream))
                contents.channels[channel.id] = (channel.topic, contents.schemas.get(channel.schema_id, ""))
            elif opcode == _DATA_END:
                contents.is_whole = True
            elif opcode == _FOOTER:
                break
            stream.seek(offset + length)
        return contents
