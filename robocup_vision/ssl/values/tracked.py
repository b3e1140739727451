"""A tracker's estimate: one world over all cameras, with velocities. The message is in metres already."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from robocup_vision.ssl.protocol.mapping import OpenEnum, Wire, message_value


class TeamColor(OpenEnum):
    """Which team; numbered as the game controller numbers them."""

    UNKNOWN = 0
    YELLOW = 1
    BLUE = 2


class Capability(OpenEnum):
    """What a tracker can do."""

    UNKNOWN = 0
    DETECT_FLYING_BALLS = 1
    DETECT_MULTIPLE_BALLS = 2
    DETECT_KICKED_BALLS = 3


@message_value("tracked.Vector2")
@dataclass(frozen=True, slots=True)
class Vector2:
    """Along the floor, field frame, metres or metres a second."""

    x: float
    y: float
    unknown: bytes = b""


@message_value("tracked.Vector3")
@dataclass(frozen=True, slots=True)
class Vector3:
    """In space, field frame, z up, metres or metres a second."""

    x: float
    y: float
    z: float
    unknown: bytes = b""


@message_value("tracked.RobotId")
@dataclass(frozen=True, slots=True)
class TrackedRobotId:
    """A robot's number and team."""

    number: Annotated[int, Wire("id")]
    team: Annotated[TeamColor, Wire("team_color")]
    unknown: bytes = b""


@message_value("tracked.TrackedBall")
@dataclass(frozen=True, slots=True)
class TrackedBall:
    """A ball, how it moves, and how well it is seen (0 to 1)."""

    position_m: Annotated[Vector3, Wire("pos")]
    velocity_mps: Annotated[Vector3 | None, Wire("vel")] = None
    visibility: float | None = None
    unknown: bytes = b""


@message_value("tracked.KickedBall")
@dataclass(frozen=True, slots=True)
class KickedBall:
    """A ball as it was kicked: when, where, how fast, by whom, and where it will lie still."""

    position_m: Annotated[Vector2, Wire("pos")]
    velocity_mps: Annotated[Vector3, Wire("vel")]
    start_s: Annotated[float, Wire("start_timestamp")]
    stop_s: Annotated[float | None, Wire("stop_timestamp")] = None
    stop_position_m: Annotated[Vector2 | None, Wire("stop_pos")] = None
    robot: Annotated[TrackedRobotId | None, Wire("robot_id")] = None
    unknown: bytes = b""


@message_value("tracked.TrackedRobot")
@dataclass(frozen=True, slots=True)
class TrackedRobot:
    """A robot, how it moves, and how well it is seen (0 to 1)."""

    robot: Annotated[TrackedRobotId, Wire("robot_id")]
    position_m: Annotated[Vector2, Wire("pos")]
    orientation_rad: Annotated[float, Wire("orientation")]
    velocity_mps: Annotated[Vector2 | None, Wire("vel")] = None
    turn_rps: Annotated[float | None, Wire("vel_angular")] = None
    visibility: float | None = None
    unknown: bytes = b""


@message_value("tracked.TrackedFrame")
@dataclass(frozen=True, slots=True)
class TrackedFrame:
    """The world at one moment, seconds since 1970."""

    frame_number: int
    t_s: Annotated[float, Wire("timestamp")]
    balls: tuple[TrackedBall, ...] = ()
    robots: tuple[TrackedRobot, ...] = ()
    kicked_ball: KickedBall | None = None
    capabilities: tuple[Capability, ...] = ()
    unknown: bytes = b""


@message_value("tracked.TrackerWrapperPacket")
@dataclass(frozen=True, slots=True)
class TrackerPacket:
    """One datagram of a tracker; `uuid` identifies the running tracker."""

    uuid: str
    source_name: str | None = None
    frame: Annotated[TrackedFrame | None, Wire("tracked_frame")] = None
    unknown: bytes = b""
