"""What is in a log: how many entries of each kind, over which time, who sent them, and what is wrong with some."""

from __future__ import annotations

from dataclasses import dataclass, field

from robocup_vision.ssl.log import LogKind, SslLog, Unreadable, readable
from robocup_vision.ssl.values.detection import VisionPacket
from robocup_vision.ssl.values.referee import Referee
from robocup_vision.ssl.values.tracked import TrackerPacket

NS_PER_S = 1e9


@dataclass(slots=True)
class LogInfo:
    """What a log holds."""

    entries: dict[str, int] = field(default_factory=dict)  #: how many of each kind, by name
    #: when the first and the last entry with a time were received
    first_ns: int | None = None
    last_ns: int | None = None
    cameras: dict[int, int] = field(default_factory=dict)  #: detection frames of each camera
    geometry_packets: int = 0  #: packets with a geometry
    field_m: tuple[float, float] | None = None  #: length and width of the field in the last geometry
    trackers: dict[str, int] = field(default_factory=dict)  #: packets of each tracker, by its name or else its uuid
    #: the referee's commands in their order, each when its counter changed
    commands: list[str] = field(default_factory=list)
    teams: tuple[str, str] | None = None  #: names of yellow and blue
    score: tuple[int, int] | None = None  #: goals of yellow and blue in the last referee packet
    unreadable: Unreadable = field(default_factory=Unreadable)  #: what could not be read

    @property
    def duration_s(self) -> float:
        """Between the first and the last entry."""
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
