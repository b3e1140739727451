"""The true state of the world at one moment, as plain values for renderer, report and referee, never for a player."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from robocup_vision.geometry import Pose2
from sim2d.robot_link import Command, Phase, PlayerStatus, Senses

EventKind = Literal["kick", "goal", "ball_out", "drop", "collision", "carried_back", "whistle"]


@dataclass(frozen=True, slots=True)
class RobotState:
    """True state of one robot."""

    #: Index among all robots, side +1 first.
    index: int
    #: +1: attacks the goal at +x; -1: the one at -x.
    side: int
    #: Number within its side.
    number: int
    #: Pose, field frame.
    pose: Pose2
    #: Velocity, field frame.
    velocity_mps: tuple[float, float]
    #: Turning rate, radians per second.
    turn_rps: float
    #: Pan of the head that carries a pinhole camera.
    pan_rad: float = 0.0
    #: Radius and height of its hull.
    radius_m: float = 0.09
    height_m: float = 0.15


@dataclass(frozen=True, slots=True)
class BallState:
    """The ball's place and velocity, field frame; `z_m` is the height of its lower side, 0 while it rolls."""

    x_m: float
    y_m: float
    vx_mps: float = 0.0
    vy_mps: float = 0.0
    z_m: float = 0.0
    vz_mps: float = 0.0


@dataclass(frozen=True, slots=True)
class Event:
    """An event of a match."""

    #: Time of the event.
    t_s: float
    #: ``kick``, ``goal``, ``ball_out``, ``drop`` (a ball that lay still is put elsewhere), ``collision``,
    #: ``carried_back`` (a robot that left the field), ``whistle`` (play begins).
    kind: EventKind
    #: Indices of the robots involved; a collision with something fixed has one.
    robots: tuple[int, ...] = ()
    #: Goal: side that scored; 0 otherwise.
    side: int = 0
    #: Collision: speed of approach; kick: speed of the ball; 0 otherwise.
    speed_mps: float = 0.0


@dataclass(frozen=True, slots=True)
class WorldState:
    """True state of the world at one moment."""

    #: Time since the start.
    t_s: float
    #: Robots in order of their index.
    robots: tuple[RobotState, ...]
    #: The ball; None on a course without one.
    ball: BallState | None
    #: Goals of side +1, of side -1.
    score: tuple[int, int]
    #: Phase of play; during a kick-off the ball lies at the centre until the whistle.
    phase: Phase
    #: Side whose turn it is at a kick-off, free kick, penalty or ball placement: +1 or -1.
    kick_off_side: int
    #: Events of the last control period.
    events: tuple[Event, ...]
    #: Where the ball is to be placed, in phase "ball_placement".
    placement_m: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class RobotMoment:
    """One robot in one control period."""

    #: Senses of the robot.
    senses: Senses
    #: Its player's status after them.
    status: PlayerStatus
    #: Its player's command.
    command: Command
    #: Reason why its player was stopped; empty if it was not.
    stopped: str


@dataclass(frozen=True, slots=True)
class Moment:
    """One control period of a match: the true state when the robots sensed, and the robots in order of their index."""

    state: WorldState
    robots: tuple[RobotMoment, ...]
