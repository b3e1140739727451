"""Markings of the field in one frame, robot frame, which a team can fuse into its own localisation.

Each is measured by one frame. With a known pose, `feature_m` identifies its part of the field.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, TypeVar

import numpy as np

from robocup_vision.arrays import FloatArray, read_only
from robocup_vision.geometry import Pose2, turned_covariance, wrap_angle

_STILL = Pose2(0.0, 0.0, 0.0)
# greatest standard deviation of a reported place
MAX_STD_M = 0.5
# gate of errors, in standard deviations
GATE_SIGMAS = 3.0

CrossingKind = Literal["L", "T", "X"]
# kind of a crossing by its number of arms
KINDS: dict[int, CrossingKind] = {2: "L", 3: "T", 4: "X"}


@dataclass(frozen=True, slots=True, eq=False)
class LineSegment:
    """A stretch of a straight line.

    The line is x cos(angle_rad) + y sin(angle_rad) = distance_m. The ends may differ from those of the field's line,
    where the stretch leaves the view or is occluded.
    """

    #: ends, robot frame, metres; the line's normal is to the right of the direction from start to end
    start_m: tuple[float, float]
    end_m: tuple[float, float]
    angle_rad: float  #: direction of the line's normal, away from the robot, robot frame
    distance_m: float  #: distance of the line from the robot's centre, never negative
    covariance: FloatArray  #: (2, 2) float64: covariance of (angle_rad, distance_m), in rad and m
    #: the field's line of which it is a part, x0, y0, x1, y1, field frame; None if not known
    feature_m: tuple[float, float, float, float] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "covariance", read_only(self.covariance))

    @property
    def length_m(self) -> float:
        """Distance from start to end."""
        return float(np.hypot(self.end_m[0] - self.start_m[0], self.end_m[1] - self.start_m[1]))


@dataclass(frozen=True, slots=True, eq=False)
class MarkedSpot:
    """A marking at one place of the floor."""

    #: its place, robot frame: the axis of a post on the floor, else the middle
    x_m: float
    y_m: float
    covariance: FloatArray  #: (2, 2) float64: of its place, square metres

    def __post_init__(self) -> None:
        object.__setattr__(self, "covariance", read_only(self.covariance))


@dataclass(frozen=True, slots=True, eq=False)
class Crossing(MarkedSpot):
    """A place where two lines meet at right angles."""

    #: a corner, a line's end on another line, or two lines that both continue; None if an arm is occluded or out of
    #: view and no pose identifies it
    kind: CrossingKind | None
    arms_rad: tuple[float, ...]  #: directions of the visible arms, robot frame
    feature_m: tuple[float, float] | None = None  #: the field's crossing, field frame; None if not known


@dataclass(frozen=True, slots=True, eq=False)
class Circle(MarkedSpot):
    """The centre circle, or another arc of the field."""

    radius_m: float  #: radius of the fitting circle of the field
    #: the centre of the field's circle, field frame; None if not known
    feature_m: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Post(MarkedSpot):
    """A goal post."""

    feature_m: tuple[float, float] | None = None  #: the field's post, field frame; None if not known


@dataclass(frozen=True, slots=True, eq=False)
class PenaltyMark(MarkedSpot):
    """A penalty mark: a dot or a small cross on the carpet."""

    feature_m: tuple[float, float] | None = None  #: the field's mark, field frame; None if not known


Spot = TypeVar("Spot", Crossing, Circle, Post, PenaltyMark)


@dataclass(frozen=True, slots=True)
class Markings:
    """All markings of one frame, each kind sorted by accuracy."""

    #: markings of each kind; empty if none is visible or the camera's tilt is not known
    segments: tuple[LineSegment, ...] = ()
    crossings: tuple[Crossing, ...] = ()
    circles: tuple[Circle, ...] = ()
    posts: tuple[Post, ...] = ()
    penalty_marks: tuple[PenaltyMark, ...] = ()

    def moved(self, robot: Pose2) -> Markings:
        """Return the markings in the frame of a robot that has moved to `robot`, given in its previous frame."""
        if robot == _STILL:
            return self
        motion = robot.inverse()

        def spot(one: Spot) -> Spot:
            x, y = motion.transform((one.x_m, one.y_m)).tolist()
            moved = replace(one, x_m=x, y_m=y, covariance=turned_covariance(one.covariance, motion.theta_rad))
            if isinstance(moved, Crossing):
                return replace(moved, arms_rad=tuple(wrap_angle(arm + motion.theta_rad) for arm in moved.arms_rad))
            return moved

        return Markings(
            tuple(_moved(one, motion) for one in self.segments),
            tuple(map(spot, self.crossings)),
            tuple(map(spot, self.circles)),
            tuple(map(spot, self.posts)),
            tuple(map(spot, self.penalty_marks)),
        )

    def __bool__(self) -> bool:
        return bool(self.segments or self.crossings or self.circles or self.posts or self.penalty_marks)


def _moved(segment: LineSegment, motion: Pose2) -> LineSegment:
    (x0, y0), (x1, y1) = motion.transform(np.array([segment.start_m, segment.end_m])).tolist()
    angle = segment.angle_rad + motion.theta_rad
    normal = np.array([np.cos(angle), np.sin(angle)])
    along = float(-normal[1] * motion.x_m + normal[0] * motion.y_m)
    distance = segment.distance_m + float(normal @ (motion.x_m, motion.y_m))
    # a rotation of the line moves it at the robot's new place
    row = np.array([[1.0, 0.0], [along, 1.0]])
    covariance = row @ segment.covariance @ row.T
    if distance < 0.0:
        x0, y0, x1, y1, angle, distance = x1, y1, x0, y0, angle + np.pi, -distance
        covariance = covariance * [[1.0, -1.0], [-1.0, 1.0]]
    return replace(
        segment,
        start_m=(x0, y0),
        end_m=(x1, y1),
        angle_rad=wrap_angle(angle),
        distance_m=distance,
        covariance=covariance,
    )
