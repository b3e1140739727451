"""The values that pass between a player and its robot: setup, senses, commands, status.

This module does not import the world, so a player that imports it cannot reach the truth.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal, Protocol, TypeAlias

from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.calibration.online import OnlineState
from robocup_vision.camera import OmniCamera, PinholeCamera, Rig
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.motion_limits import MotionLimits
from robocup_vision.perception.color_table import Colors
from robocup_vision.view import View

# a position on the floor, or a displacement, metres
Point: TypeAlias = tuple[float, float]

# time between two commands of a player, and between two frames
CONTROL_PERIOD_S = 1 / 30
# times within this of each other count as equal: sums of control periods have rounding errors
TIME_SLACK_S = 1e-6

# phases of play; only a referee of the small-size league gives others than the first two
Phase = Literal[
    "kick_off",
    "play",
    "halt",
    "stop",
    "time_out",
    "free_kick",
    "prepare_penalty",
    "penalty",
    "ball_placement",
]


@dataclass(frozen=True, slots=True)
class RobotLimits(MotionLimits):
    """The limits of a robot's motion, kick and pan, and its size.

    Parameters
    ----------
    radius_m, height_m : float
        Size of the robot, an upright cylinder.
    speed_mps, turn_rps : float
        Largest speed in any direction, metres per second, and largest turning rate, radians per second.
    acceleration_mps2 : float
        Largest change of the velocity vector, in any direction (Sekimori et al. 2001, eq. 10).
    turn_acceleration_rps2 : float
        Largest change of the turning rate.
    dead_time_s : float
        Time from a command until the wheels obey it.
    kick_speed_mps : float
        Largest speed that the kicker gives the ball.
    pan_rps, pan_limit_rad : float
        Turning rate of a pinhole camera's head, radians per second, and its greatest pan to either side. Commands reach
        the neck after the same dead time as the wheels.
    """

    speed_mps: float = 1.0
    acceleration_mps2: float = 1.2
    dead_time_s: float = 0.03
    radius_m: float = 0.09
    height_m: float = 0.14
    turn_rps: float = 6.0
    turn_acceleration_rps2: float = 30.0
    kick_speed_mps: float = 2.0
    pan_rps: float = 8.0
    pan_limit_rad: float = math.pi / 2


@dataclass(frozen=True, slots=True)
class PlayerSetup:
    """A player's data before the match.

    Parameters
    ----------
    field : Field
        The pitch; both teams use the same field frame.
    camera : OmniCamera or PinholeCamera
        The robot's camera as calibrated.
    limits : RobotLimits
        The robot's limits.
    attacks : int
        +1: the opponent's goal is at +x of the field frame; -1: at -x.
    number : int
        0, 1, ... within its side; 0 keeps the goal if the side has several players.
    players : int
        Number of players per side.
    seed : int
        Seed of the player's own random numbers.
    camera_is_rough : bool
        Whether the true camera may differ from `camera`, and may be knocked, so that calibration in play is needed.
    has_legs : bool
        Whether the odometry is that of legs.
    rig : Rig or None
        All cameras of a robot with several, of which `camera` is the first; None: it has one camera.
    """

    field: Field
    camera: OmniCamera | PinholeCamera
    limits: RobotLimits
    attacks: int
    number: int
    players: int
    seed: int
    camera_is_rough: bool = False
    has_legs: bool = False
    rig: Rig | None = None

    @property
    def sees_ahead_only(self) -> bool:
        """Whether the robot has a single camera, which looks ahead."""
        return self.rig is None and isinstance(self.camera, PinholeCamera)


@dataclass(frozen=True)
class Senses:
    """Everything that a player receives, 30 times per second.

    Parameters
    ----------
    t_s : float
        The present time.
    frame : (H, W, 3) uint8 or None
        The newest camera frame, BGR; None if it was dropped. For a rig that of the first camera.
    frame_t_s : float or None
        Time of the frame's exposure; may be some time ago.
    odometry : Pose2
        Motion since the senses before, in the robot frame at that time, measured by the wheels.
    ball_in_mouth : bool
        Whether the ball interrupts the light barrier in the dribbler's mouth.
    phase : Phase
        The phase that the referee announced last. A whistled kick-off is a free kick until the ball has moved.
    own_turn : bool
        Whether the own team has the kick-off, free kick, penalty or ball placement.
    frame_pan_rad : float or None
        Pan of the head when the frame was exposed, measured by the neck's joint, from straight ahead, positive to the
        left; None without a frame, and where the camera does not pan.
    placement_in_field : (float, float) or None
        Where the ball is to be placed, in phase "ball_placement", field frame.
    messages : tuple of bytes
        Messages of the own team that have arrived since the senses before, in the order of arrival.
    rig_frames : tuple of ((H, W, 3) uint8 or None) or None
        For a rig the frames of all cameras, exposed together; None if `frame` is, or if the robot has one camera.
    """

    t_s: float
    frame: UInt8Array | None
    frame_t_s: float | None
    odometry: Pose2
    ball_in_mouth: bool
    phase: Phase
    own_turn: bool
    frame_pan_rad: float | None = None
    placement_in_field: tuple[float, float] | None = None
    messages: tuple[bytes, ...] = ()
    rig_frames: tuple[UInt8Array | None, ...] | None = None

    def with_frame_of(self, then: Senses | None) -> Senses:
        """Return these senses with the frames of other senses; None: without frames."""
        if then is None:
            return replace(self, frame=None, frame_t_s=None, frame_pan_rad=None, rig_frames=None)
        frame_t_s, pan_rad = then.frame_t_s, then.frame_pan_rad
        return replace(self, frame=then.frame, frame_t_s=frame_t_s, frame_pan_rad=pan_rad, rig_frames=then.rig_frames)


@dataclass(frozen=True, slots=True)
class Command:
    """Everything that a player may command.

    Parameters
    ----------
    forward_mps, left_mps, turn_rps : float
        Wanted velocity in the robot frame.
    kick_mps : float
        Speed to kick the ball with; 0: do not kick.
    dribble : bool
        Whether the dribbler spins.
    pan_rad : float or None
        Wanted pan of a pinhole camera's head, from straight ahead, positive to the left; None: unchanged.
    message : bytes or None
        Message to the others of the team, at most 128 bytes; of two within half a second only the first is sent.
    """

    forward_mps: float = 0.0
    left_mps: float = 0.0
    turn_rps: float = 0.0
    kick_mps: float = 0.0
    dribble: bool = False
    pan_rad: float | None = None
    message: bytes | None = None


@dataclass(frozen=True, slots=True)
class Reason:
    """The reason of a player's choice.

    Parameters
    ----------
    topic : {"gap", "speed", "gaze", "shot"}
        The choice.
    choice : str
        The choice in a word or two, of a small vocabulary, so that choices can be counted.
    text : str
        The reason, with figures.
    """

    topic: Literal["gap", "speed", "gaze", "shot"]
    choice: str
    text: str


@dataclass(frozen=True, slots=True)
class PlayerStatus:
    """A player's report about itself, for films and reports. The match does not use it.

    Parameters
    ----------
    pose : PoseEstimate or NotLocated
        Estimated pose of the robot.
    ball_in_field : (float, float) or None
        Estimated position of the ball, field frame, metres.
    intent : str
        What the robot is about to do, in one or two words.
    view : View or None
        Results of the last frame.
    reasons : tuple of Reason
        Reasons of its plans, at most one of each topic; empty if it does not plan.
    waypoint_in_field : (float, float) or None
        First waypoint on the way to its target, field frame.
    gap_in_field : ((float, float), (float, float)) or None
        Ends of the gap that it drives through, field frame.
    speed_mps : float or None
        Its planned speed limit.
    gaze_rad : float or None
        Planned pan of the head, from straight ahead; None if none is planned now.
    colors : Colors or None
        Colours that its vision uses.
    calibration : OnlineState or None
        Its estimate of its camera; None if it does not calibrate.
    """

    pose: PoseEstimate | NotLocated
    ball_in_field: tuple[float, float] | None
    intent: str
    view: View | None
    reasons: tuple[Reason, ...] = ()
    waypoint_in_field: tuple[float, float] | None = None
    gap_in_field: tuple[tuple[float, float], tuple[float, float]] | None = None
    speed_mps: float | None = None
    gaze_rad: float | None = None
    colors: Colors | None = None
    calibration: OnlineState | None = None


class Player(Protocol):
    """Plays one robot."""

    def act(self, senses: Senses) -> Command:
        """Return the command that holds until the next senses."""

    @property
    def status(self) -> PlayerStatus:
        """Estimates and plans after the last `act`."""


PlayerFactory: TypeAlias = Callable[[PlayerSetup], Player]
