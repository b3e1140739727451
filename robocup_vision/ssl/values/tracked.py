"""Messages with a tracker's estimate of the world from all cameras, with velocities; lengths are in metres."""

from __future__ import annotations

from typing import Annotated

from robocup_vision.ssl.protocol.mapping import Message, OpenEnum, Wire, message_value
from robocup_vision.ssl.values.simulation import Team


class Capability(OpenEnum):
    """Abilities of a tracker."""

    UNKNOWN = 0
    DETECT_FLYING_BALLS = 1
    DETECT_MULTIPLE_BALLS = 2
    DETECT_KICKED_BALLS = 3


@message_value("tracked.Vector2")
class Vector2(Message):
    """A vector along the floor, field frame, metres or metres per second."""

    x: Annotated[float, Wire(1)]
    y: Annotated[float, Wire(2)]


@message_value("tracked.Vector3")
class Vector3(Message):
    """A vector in space, field frame, z up, metres or metres per second."""

    x: Annotated[float, Wire(1)]
    y: Annotated[float, Wire(2)]
    z: Annotated[float, Wire(3)]


@message_value("tracked.RobotId")
class TrackedRobotId(Message):
    """A robot's number and team."""

    number: Annotated[int, Wire(1, "id")]
    team: Annotated[Team, Wire(2, "team_color")]


@message_value("tracked.TrackedBall")
class TrackedBall(Message):
    """A ball with its velocity and visibility (0 to 1)."""

    position_m: Annotated[Vector3, Wire(1, "pos")]
    velocity_mps: Annotated[Vector3 | None, Wire(2, "vel")] = None
    visibility: Annotated[float | None, Wire(3)] = None


@message_value("tracked.KickedBall")
class KickedBall(Message):
    """A kick: time, place, velocity and robot, and where and when the ball will stop."""

    position_m: Annotated[Vector2, Wire(1, "pos")]
    velocity_mps: Annotated[Vector3, Wire(2, "vel")]
    start_s: Annotated[float, Wire(3, "start_timestamp", kind="double")]
    stop_s: Annotated[float | None, Wire(4, "stop_timestamp", kind="double")] = None
    stop_position_m: Annotated[Vector2 | None, Wire(5, "stop_pos")] = None
    robot: Annotated[TrackedRobotId | None, Wire(6, "robot_id")] = None


@message_value("tracked.TrackedRobot")
class TrackedRobot(Message):
    """A robot with its velocities and visibility (0 to 1)."""

    robot: Annotated[TrackedRobotId, Wire(1, "robot_id")]
    position_m: Annotated[Vector2, Wire(2, "pos")]
    orientation_rad: Annotated[float, Wire(3, "orientation")]
    velocity_mps: Annotated[Vector2 | None, Wire(4, "vel")] = None
    turn_rps: Annotated[float | None, Wire(5, "vel_angular")] = None
    visibility: Annotated[float | None, Wire(6)] = None


@message_value("tracked.TrackedFrame")
class TrackedFrame(Message):
    """The world at one moment; `t_s` counts seconds since 1970."""

    frame_number: Annotated[int, Wire(1)]
    t_s: Annotated[float, Wire(2, "timestamp", kind="double")]
    balls: Annotated[tuple[TrackedBall, ...], Wire(3)] = ()
    robots: Annotated[tuple[TrackedRobot, ...], Wire(4)] = ()
    kicked_ball: Annotated[KickedBall | None, Wire(5)] = None
    capabilities: Annotated[tuple[Capability, ...], Wire(6)] = ()


@message_value("tracked.TrackerWrapperPacket")
class TrackerPacket(Message):
    """One datagram of a tracker; `uuid` identifies the running tracker."""

    uuid: Annotated[str, Wire(1)]
    source_name: Annotated[str | None, Wire(2)] = None
    frame: Annotated[TrackedFrame | None, Wire(3, "tracked_frame")] = None
