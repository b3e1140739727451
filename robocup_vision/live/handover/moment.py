"""One moment of one robot as the page shows it: the frame, what was seen in it, and what the robot is about to do."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera import OmniCamera, PinholeCamera
from robocup_vision.geometry import Pose2
from robocup_vision.perception.color_table import Colors
from robocup_vision.view import View

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class RobotSetup:
    """What stays the same of a robot.

    Parameters
    ----------
    name : str
        What the page calls it; no two robots of a page share one.
    field : Field
        The pitch it is on.
    camera : OmniCamera or PinholeCamera or None
        Its camera; None: not calibrated yet.
    radius_m : float
        Its size from above.
    """

    name: str
    field: Field
    camera: OmniCamera | PinholeCamera | None
    radius_m: float


@dataclass(frozen=True, slots=True)
class RobotPlan:
    """What a robot is about to do.

    Parameters
    ----------
    command : (float, float, float) or None
        Commanded velocity in the robot frame: forward and left in m/s, turn in rad/s.
    way : tuple of (float, float)
        Points it drives to, in order, field frame, metres.
    reasons : tuple of str
        Why, in words.
    """

    command: tuple[float, float, float] | None = None
    way: tuple[Point, ...] = ()
    reasons: tuple[str, ...] = ()


class TrueRobot(NamedTuple):
    """Where a simulated robot is: its name, its side (+1 attacks the goal at +x, -1 the other one), its pose."""

    name: str
    side: int
    pose: Pose2


class TrueWorld(NamedTuple):
    """Where everything is in a simulation, field frame; what has a name, and the "ball", can be put elsewhere."""

    robots: tuple[TrueRobot, ...]
    ball_m: Point | None


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """One moment of one robot.

    Parameters
    ----------
    robot : str
        Its name.
    frame : (H, W, 3) uint8
        BGR. Nobody writes to it any more.
    t_s : float
        When it was taken.
    view : View or None
        What was seen in it; None: nobody has looked at it.
    problem : str
        Why nobody has looked at it; empty otherwise.
    colors : Colors or None
        In use when it was looked at.
    plan : RobotPlan
        What the robot is about to do.
    truth : Pose2 or None
        Where it really was, if that is known, as in a simulation.
    rate_hz : float or None
        How often the source gives frames, by their times.
    settings : mapping of str to str
        Words to show beside: the method, and what else does not change often.
    world : TrueWorld or None
        Where everything was in a simulation.
    """

    robot: str
    frame: UInt8Array
    t_s: float
    view: View | None = None
    problem: str = ""
    colors: Colors | None = None
    plan: RobotPlan = RobotPlan()
    truth: Pose2 | None = None
    rate_hz: float | None = None
    settings: Mapping[str, str] | None = None
    world: TrueWorld | None = None
