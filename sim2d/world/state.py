"""The true state of the world at one moment, as plain values: for renderer, report and referee, never for a player."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from robocup_vision.geometry import Pose2
from sim2d.robot_link import Phase

EventKind = Literal["kick", "goal", "ball_out", "drop", "collision", "carried_back", "whistle"]


@dataclass(frozen=True, slots=True)
class RobotState:
    """One robot.

    Parameters
    ----------
    index : int
        Among all robots, side +1 first.
    side : int
        +1: attacks the goal at +x; -1: the one at -x.
    number : int
        Within its side.
    pose : Pose2
        Field frame.
    velocity_mps : (float, float)
        Field frame.
    turn_rps : float
        Turning rate, radians a second.
    pan_rad : float
        Of the head that carries a pinhole camera.
    """

    index: int
    side: int
    number: int
    pose: Pose2
    velocity_mps: tuple[float, float]
    turn_rps: float
    pan_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class BallState:
    """The ball's place and velocity, field frame; `z_m` is its height above where it lies, 0 while it rolls."""

    x_m: float
    y_m: float
    vx_mps: float = 0.0
    vy_mps: float = 0.0
    z_m: float = 0.0
    vz_mps: float = 0.0


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened.

    Parameters
    ----------
    t_s : float
        When.
    kind : str
        ``kick``, ``goal``, ``ball_out``, ``drop`` (a ball that lay still is put elsewhere), ``collision``,
        ``carried_back`` (a robot that left the field), ``whistle`` (play begins).
    robots : tuple of int
        Those that took part; a collision with something fixed has one.
    side : int
        Goal: that scored; 0 otherwise.
    speed_mps : float
        Collision: speed of approach; kick: of the ball; 0 otherwise.
    """

    t_s: float
    kind: EventKind
    robots: tuple[int, ...] = ()
    side: int = 0
    speed_mps: float = 0.0


@dataclass(frozen=True, slots=True)
class WorldState:
    """The whole world at one moment.

    Parameters
    ----------
    t_s : float
        Since the start.
    robots : tuple of RobotState
        In order of their index.
    ball : BallState or None
        None on a course without one.
    score : (int, int)
        Goals of side +1, of side -1.
    phase : Phase
        Kick-off: the ball lies at the centre until the whistle.
    kick_off_side : int
        Whose turn it is at a kick-off, free kick, penalty or ball placement: +1 or -1.
    events : tuple of Event
        What happened during the last control period.
    placement_m : (float, float) or None
        Where the ball shall be placed, in phase "ball_placement".
    """

    t_s: float
    robots: tuple[RobotState, ...]
    ball: BallState | None
    score: tuple[int, int]
    phase: Phase
    kick_off_side: int
    events: tuple[Event, ...]
    placement_m: tuple[float, float] | None = None
