"""A league log as an MCAP file: the same datagrams on topics, with their definitions, as MCAP viewers read them.

Nothing is converted: the file holds the bytes that were received, and the layout of our values as their schema.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from field_models.errors import RobocupVisionError
from robocup_vision.files.output_folder import telling_write_errors
from robocup_vision.ssl.log import SslLog, Unreadable, readable
from robocup_vision.ssl.protocol.mapping import descriptor_set, message_name
from robocup_vision.ssl.values.detection import VisionPacket
from robocup_vision.ssl.values.referee import Referee
from robocup_vision.ssl.values.tracked import TrackerPacket

_TOPICS: dict[type, str] = {VisionPacket: "/vision", TrackerPacket: "/tracker", Referee: "/referee"}


def write_mcap(log: SslLog, path: Path) -> tuple[dict[str, int], Unreadable]:
    """Write the vision, tracker and referee packets of a log; blank entries, an index and unreadable ones are left out.

    Parameters
    ----------
    path : Path
        Where to; its folder is made if missing.

    Returns
    -------
    (dict of str to int, Unreadable)
        Messages of each topic, and what could not be read.

    Raises
    ------
    RobocupVisionError
        If mcap is not installed.
    FileError
        If the file cannot be written.
    """
    try:
        from mcap.writer import Writer
    except ImportError:
        raise RobocupVisionError(
            "MCAP files need mcap, which is not installed: pip install 'robocup-vision[ros]'"
        ) from None
    counts: dict[str, int] = {}
    channels: dict[type, int] = {}
    unreadable = Unreadable()
    with telling_write_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("wb") as file:
            writer: Any = Writer(file)
            writer.start(library="robocup-vision")
            for _, entry, value in readable(log, unreadable):
                if value is None:
                    continue
                kind = type(value)
                topic = _TOPICS[kind]
                if kind not in channels:
                    schema = writer.register_schema(message_name(kind), "protobuf", descriptor_set(kind))
                    channels[kind] = writer.register_channel(topic, "protobuf", schema)
                time_ns = max(entry.received_ns, 0)
                writer.add_message(channels[kind], time_ns, entry.data, time_ns, counts.get(topic, 0))
                counts[topic] = counts.get(topic, 0) + 1
            writer.finish()
    return counts, unreadable
