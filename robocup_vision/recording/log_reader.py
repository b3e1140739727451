"""An MCAP file read part by part, whole or cut: a cut one ends at its last whole chunk, or message outside of chunks.

Nothing of it is looked up in an index, which other programs may leave out.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any, NamedTuple

from field_models.errors import FileError
from robocup_vision.messages.types import require_ros_extra

_MAGIC = b"\x89MCAP0\r\n"
# of a record: opcode and length; of a chunk: first and last time; of a message: channel, number, time
_RECORD = struct.Struct("<BQ")
_CHUNK_TIMES = struct.Struct("<QQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_CHUNK, _ATTACHMENT, _METADATA, _DATA_END, _FOOTER = 0x06, 0x09, 0x0C, 0x0F, 0x02
_SCHEMA, _CHANNEL, _MESSAGE = 0x03, 0x04, 0x05
_CDR = "cdr"


class Logged(NamedTuple):
    """One message as it stands in a file: topic, type's name, time in nanoseconds, and CDR."""

    topic: str
    type_name: str
    time_ns: int
    data: bytes


class _Place(NamedTuple):
    """Where a chunk is, or a message that is in none."""

    offset: int
    length: int
    first_ns: int
    last_ns: int
    is_chunk: bool


class LogReader:
    """Reads the messages of an MCAP file in the order they were written.

    Attributes
    ----------
    attachments : dict of str to bytes
        Contents by name.
    notes : dict of str to str
        What its writer noted when it closed the file; empty for a cut file.
    is_whole : bool
        Whether its writer closed it; False: it was cut off.

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
        self.attachments: dict[str, bytes] = {}
        self.notes: dict[str, str] = {}
        self.is_whole = False
        self._places: list[_Place] = []
        # of the summary at the end, which a cut file has not
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
        """Names of the messages' types by topic; what is in no CDR has its encoding behind the type's name."""
        if self._has_end and self._channels:
            return dict(self._channels.values())
        # without a summary, channels are known from the chunks alone
        return {logged.topic: logged.type_name for logged in self.messages(on_damage=lambda problem: None)}

    @property
    def span_ns(self) -> tuple[int, int] | None:
        """First and last time of its messages; None where there are none."""
        if not self._places:
            return None
        return min(place.first_ns for place in self._places), max(place.last_ns for place in self._places)

    def messages(
        self, from_ns: int | None = None, to_ns: int | None = None, on_damage: Callable[[str], None] | None = None
    ) -> Iterator[Logged]:
        """Yield the messages between two times, both included, in the order they were written.

        `on_damage` takes what is wrong with a chunk that cannot be read, and is left out; without it a FileError is
        raised.
        """
        from mcap.records import Channel, Message, Schema

        schemas, channels = dict(self._schemas), dict(self._channels)
        is_known = bool(channels)
        with self.path.open("rb") as stream:
            for place in self._places:
                is_outside = (to_ns is not None and place.first_ns > to_ns) or (
                    from_ns is not None and place.last_ns < from_ns
                )
                # without a summary, channels are known from the chunks before alone
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
        """Find chunks and messages by their records' headers, without reading what is in them."""
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
            except Exception:  # damaged, as mcap, struct or the text's encoding find it: what follows has no meaning
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
