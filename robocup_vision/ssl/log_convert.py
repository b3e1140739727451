"""Converts a league log to tables in the messages' own units, or to an MCAP file with the same datagrams on topics.

The columns of detections and referee packets are those commonly used for the league's recordings. For MCAP nothing is
converted: the file holds the bytes that were received, with a schema made from our message types.
Both functions raise `FileError` if the output cannot be written; MCAP needs mcap, else `RobocupVisionError` is raised.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from field_models.errors import RobocupVisionError
from robocup_vision.files.output_folder import telling_write_errors
from robocup_vision.ssl.log import SslLog, Unreadable, readable
from robocup_vision.ssl.protocol.mapping import descriptor_set, message_name
from robocup_vision.ssl.values.detection import DetectionFrame, VisionPacket
from robocup_vision.ssl.values.referee import Referee
from robocup_vision.ssl.values.tracked import TrackedFrame, TrackerPacket

# fmt: off
DETECTION_COLUMNS = (
    "datagram", "camera_id", "frame_number", "t_capture_s", "kind", "robot_id", "x_mm", "y_mm", "orientation_rad",
    "confidence",
)
REFEREE_COLUMNS = (
    "received_ns", "packet_timestamp_us", "stage", "stage_time_left_us", "command", "command_counter",
    "command_timestamp_us", "yellow_name", "yellow_score", "yellow_goalkeeper", "blue_name", "blue_score",
    "blue_goalkeeper", "designated_x_mm", "designated_y_mm", "blue_on_positive_half", "next_command",
    "action_time_remaining_us", "size_bytes",
)
TRACKED_COLUMNS = (
    "datagram", "source", "frame_number", "t_s", "kind", "robot_id", "x_m", "y_m", "z_m", "orientation_rad",
    "vx_mps", "vy_mps", "vz_mps", "turn_rps", "visibility",
)
# fmt: on
FILES = {"detections": DETECTION_COLUMNS, "referee": REFEREE_COLUMNS, "tracked": TRACKED_COLUMNS}
_TOPICS: dict[type, str] = {VisionPacket: "/vision", TrackerPacket: "/tracker", Referee: "/referee"}


def write_tables(log: SslLog, folder: Path) -> tuple[dict[str, int], Unreadable]:
    """Write ``detections.csv``, ``referee.csv`` and ``tracked.csv``, except those without rows.

    Parameters
    ----------
    folder : Path
        Output folder; made if missing.

    Returns
    -------
    (dict of str to int, Unreadable)
        Number of rows of each table that has any, and what could not be read.
    """
    rows, unreadable = dict.fromkeys(FILES, 0), Unreadable()
    with telling_write_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
        # rows are written one by one, because the tables of a match would need much memory
        opened = {name: (folder / f"{name}.csv").open("w", newline="", encoding="utf-8") for name in FILES}
        try:
            writers = {name: csv.writer(file, lineterminator="\n") for name, file in opened.items()}
            for name, columns in FILES.items():
                writers[name].writerow(columns)
            for name, row in _rows(log, unreadable):
                writers[name].writerow(row)
                rows[name] += 1
        finally:
            for file in opened.values():
                file.close()
        for name, count in rows.items():
            if not count:
                (folder / f"{name}.csv").unlink()
    return {name: count for name, count in rows.items() if count}, unreadable


def _rows(log: SslLog, unreadable: Unreadable) -> Iterator[tuple[str, list[Any]]]:
    for index, entry, value in readable(log, unreadable):
        if isinstance(value, VisionPacket) and value.detection is not None:
            yield from (("detections", row) for row in _detections(index, value.detection))
        elif isinstance(value, Referee):
            yield "referee", _referee(entry.received_ns, value, len(entry.data))
        elif isinstance(value, TrackerPacket) and value.frame is not None:
            yield from (("tracked", row) for row in _tracked(index, value, value.frame))


def _detections(index: int, frame: DetectionFrame) -> Iterator[list[Any]]:
    head = [index, frame.camera_id, frame.frame_number, frame.t_capture_s]
    for ball in frame.balls:
        yield [*head, "ball", "", _mm(ball.x_m), _mm(ball.y_m), "", ball.confidence]
    for kind, robots in (("yellow", frame.yellow), ("blue", frame.blue)):
        for robot in robots:
            number = "" if robot.robot_id is None else robot.robot_id
            angle = "" if robot.orientation_rad is None else robot.orientation_rad
            yield [*head, kind, number, _mm(robot.x_m), _mm(robot.y_m), angle, robot.confidence]


def _referee(received_ns: int, packet: Referee, size: int) -> list[Any]:
    place = packet.designated_position
    return [
        received_ns,
        packet.packet_time_us,
        packet.stage.name,
        packet.stage_time_left_us,
        packet.command.name,
        packet.command_counter,
        packet.command_time_us,
        *(item for team in (packet.yellow, packet.blue) for item in (team.name, team.score, team.goalkeeper)),
        "" if place is None else f"{_mm(place.x_m):g}",
        "" if place is None else f"{_mm(place.y_m):g}",
        "" if packet.blue_on_positive_half is None else int(packet.blue_on_positive_half),
        "" if packet.next_command is None else packet.next_command.name,
        packet.action_time_left_us,
        size,
    ]


def _tracked(index: int, packet: TrackerPacket, frame: TrackedFrame) -> Iterator[list[Any]]:
    head = [index, packet.source_name or packet.uuid, frame.frame_number, frame.t_s]
    for ball in frame.balls:
        place, velocity = ball.position_m, ball.velocity_mps
        moves: list[Any] = ["", "", "", ""] if velocity is None else [velocity.x, velocity.y, velocity.z, ""]
        yield [*head, "ball", "", place.x, place.y, place.z, "", *moves, ball.visibility]
    for robot in frame.robots:
        spot, speed = robot.position_m, robot.velocity_mps
        moves = ["", "", "", robot.turn_rps] if speed is None else [speed.x, speed.y, "", robot.turn_rps]
        color = robot.robot.team.name.lower()
        yield [*head, color, robot.robot.number, spot.x, spot.y, "", robot.orientation_rad, *moves, robot.visibility]


def _mm(length_m: float) -> float:
    """Return millimetres, rounded to the float32 of the message."""
    return float(np.float32(1000 * length_m))


def write_mcap(log: SslLog, path: Path) -> tuple[dict[str, int], Unreadable]:
    """Write the vision, tracker and referee packets of a log; blank entries, an index and unreadable ones are left out.

    Parameters
    ----------
    path : Path
        Output file; its folder is made if missing.

    Returns
    -------
    (dict of str to int, Unreadable)
        Number of messages of each topic, and what could not be read.
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
