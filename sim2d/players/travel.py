"""Which way, how fast, and why: what the planners make of one player's belief while it drives to its target.

Everything is in the field frame. The planners of `robocup_vision.planning` know gaps, paths and floor; here they are
asked about the opponents that are followed, the row they stand in across the way, and the floor that is remembered.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray
from robocup_vision.belief import MapPicture, Track
from robocup_vision.estimates import PoseEstimate
from robocup_vision.mapping.occupancy import UNDECIDED
from robocup_vision.planning import (
    Disc,
    Gap,
    GatePlanner,
    MotionLimits,
    PathFollower,
    PoseNoise,
    SpeedPlan,
    SpeedPlanner,
    WidthSensor,
)
from robocup_vision.planning.gaps.gap_choice import PassageTimes, choose_gap
from robocup_vision.planning.speed.undecided_floor import FREE, UndecidedFloor, UndecidedSpeed, safe_speed_mps
from sim2d.players.opponent_row import Key, Row, in_way, row_across, unit
from sim2d.robot_link import Reason, RobotLimits

Point = tuple[float, float]

# planned anew so often, or when the target has moved by so much
_REPLAN_S, _SAME_M = 0.1, 0.06
_PERIOD_S = 1 / 30
# a viewpoint so near is here
_HERE_M = 0.02
# others are placed where they will be when the robot comes, at most so far ahead
_AHEAD_S = 0.6
# so short a way, in robot radii, is left to steering: a keeper must be quick
_SHORT_RADII = 3.5
# who stands so near to the target counts only once the robot comes near
_AT_TARGET_M = 0.35
# who is slower than this stands
_STANDS_MPS = 0.25
# a ball so near to another one's rim is taken; it is left so much room
_TAKEN_M, _ROOM_M = 0.04, 0.06
# middles nearer than so many radii are of one robot
_APART_RADII = 1.6
# a gap is left for another one only if that saves so much
_BETTER_S = 0.25
# a gap less probably wide enough than the first is narrow for certain, more than the second wide
_NARROW, _WIDE = 0.02, 0.95
# where no speed is safe, steering feels its way; no plan makes a robot slower
_CREEP_MPS = 0.2
# of a pose right after a look, and of opponents as usually followed
_POSE_STD_M, _POSE_STD_RAD, _OTHERS_STD_M = 0.01, 0.01, 0.015
_ODOMETRY_SHARE = 0.03


@dataclass(frozen=True, slots=True)
class Travel:
    """How to get to a target.

    Parameters
    ----------
    waypoint : (float, float)
        Where to drive first.
    speed_mps : float
        How fast at most.
    gap : ((float, float), (float, float)) or None
        Ends of the gap that is taken, field frame.
    reasons : tuple of Reason
        Why.
    ends_there : bool
        The drive ends at the waypoint for now, not at the target.
    """

    waypoint: Point
    speed_mps: float
    gap: tuple[Point, Point] | None
    reasons: tuple[Reason, ...]
    ends_there: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """What one player believes of itself and of what is around it, field frame.

    Parameters
    ----------
    t_s : float
        Now.
    robot : PoseEstimate
        Itself.
    velocity_mps, pending_mps : (float, float)
        Its velocity, and the command that it obeys until the next one.
    tracks : tuple of Track
        Who moves, as of `age_s` ago.
    age_s : float
        Since the last look.
    floor : MapPicture or None
        Which floor is free.
    """

    t_s: float
    robot: PoseEstimate
    velocity_mps: Point
    pending_mps: Point
    tracks: tuple[Track, ...]
    age_s: float
    floor: MapPicture | None


@dataclass(frozen=True, slots=True)
class _Way:
    """Which way, and why."""

    points: tuple[Point, ...]
    ends: tuple[Point, Point] | None
    reason: Reason
    # stops for a look
    waits: bool = False


class TravelPlanner:
    """Plans the ways of one player.

    Parameters
    ----------
    field : Field
        The pitch.
    limits : RobotLimits
        Of all robots on it.
    looks : int
        How many looks decide a cell of the floor.
    """

    def __init__(self, field: Field, limits: RobotLimits, looks: int) -> None:
        self._field, self._limits, self._looks = field, limits, looks
        self._motion = _motion(limits)
        self._speeds = _speed_planner(limits)
        self._undecided = UndecidedSpeed(self._motion, limits.radius_m, _REPLAN_S)
        self._last: tuple[float, Point, Travel] | None = None
        # whose gap was taken, by their numbers
        self._taken: Key | None = None

    def plan(self, around: Surroundings, target: Point) -> Travel:
        """Plan a way to a target through what is around; ten times a second, else the last plan stands."""
        if self._last is not None:
            planned_s, there, travel = self._last
            if 0 <= around.t_s - planned_s < _REPLAN_S and math.dist(there, target) < _SAME_M:
                return travel if travel.gap is not None else replace(travel, waypoint=target)
        travel = self._plan_anew(around, target)
        self._last = (around.t_s, target, travel)
        return travel

    def approach(self, around: Surroundings, target: Point, ball: Point | None) -> Travel:
        """Plan the last piece to a ball, straight: not faster than lets the robot stop before whom it might touch.

        From behind one that has the ball it cannot be taken: that one is left room. `ball`: None if it is not known.
        """
        here = (around.robot.pose.x_m, around.robot.pose.y_m)
        way = unit(here, target)
        self._last = self._taken = None
        others = list(self._others(around, 0.0).values())
        holder = None if ball is None else self._holder(here, others, ball)
        if holder is not None:
            ring_m = holder.radius_m + self._limits.radius_m + _ROOM_M
            away_m = math.dist(here, (holder.x_m, holder.y_m))
            if away_m < ring_m + _HERE_M:
                out = unit((holder.x_m, holder.y_m), here)
                place = (holder.x_m + ring_m * out[0], holder.y_m + ring_m * out[1])
                text = f"{away_m - ring_m + _ROOM_M:.2f} m from one that has the ball"
                return Travel(place, self._limits.speed_mps, None, (Reason("speed", "leave room", text),), True)
        room = math.inf
        for disc in others:
            along, aside = in_way(disc, here, way)
            touch = disc.radius_m + self._limits.radius_m
            if along > 0 and abs(aside) < touch:
                room = min(room, along - math.sqrt(touch**2 - aside**2) - _std(disc))
        if room == math.inf:
            return Travel(target, self._limits.speed_mps, None, (Reason("speed", "full speed", "nobody at the ball"),))
        speed = safe_speed_mps(room, 1, _PERIOD_S, self._motion)
        if speed >= self._limits.speed_mps:
            return Travel(target, speed, None, (Reason("speed", "full speed", f"opponent in {room:.2f} m"),))
        speed = max(speed, _CREEP_MPS / 2)
        text = f"{speed:.2f} m/s: opponent in {max(room, 0.0):.2f} m at the ball"
        return Travel(target, speed, None, (Reason("speed", "slow: at the ball", text),))

    def carry(self, target: Point) -> Travel:
        """Take the ball somewhere: as fast as it can be held, but pushing nobody."""
        self._last = self._taken = None
        return Travel(target, self._limits.speed_mps, None, (Reason("speed", "full speed", "with the ball"),))

    def _holder(self, here: Point, others: Sequence[Disc], ball: Point) -> Disc | None:
        """Return who has the ball and stands between it and the robot."""
        nearest = min(others, key=lambda disc: math.dist((disc.x_m, disc.y_m), ball), default=None)
        if nearest is None:
            return None
        away_m = math.dist((nearest.x_m, nearest.y_m), ball)
        reach_m = nearest.radius_m + self._field.ball_radius_m + _TAKEN_M
        to_ball, to_robot = (unit((nearest.x_m, nearest.y_m), place) for place in (ball, here))
        is_behind = to_ball[0] * to_robot[0] + to_ball[1] * to_robot[1] < 0.0
        return nearest if away_m < reach_m and is_behind else None

    def _plan_anew(self, around: Surroundings, target: Point) -> Travel:
        robot = around.robot.pose
        here = (robot.x_m, robot.y_m)
        if math.dist(here, target) < _SHORT_RADII * self._limits.radius_m:
            self._taken = None
            full = Reason("speed", "full speed", "the way is short")
            return Travel(target, self._limits.speed_mps, None, (full,))
        others = self._others(around, _AHEAD_S)
        way = self._way(here, target, others)
        path = np.array([here, *way.points])
        # the planner of speeds knows things that stand; steering reckons with those that move
        moving = {t.number for t in around.tracks if math.hypot(t.vx_mps, t.vy_mps) > _STANDS_MPS}
        speed, why = self._speed(path, around, [disc for number, disc in others.items() if number not in moving])
        if way.waits:
            speed, why = _CREEP_MPS, Reason("speed", "slow: to look", f"{_CREEP_MPS:.2f} m/s: {way.reason.text}")
        return Travel(way.points[0], speed, way.ends, (way.reason, why))

    def _others(self, around: Surroundings, ahead_s: float) -> dict[int, Disc]:
        """Who is around, by number, and where they will be when the robot gets there."""
        robot, discs = around.robot.pose, {}
        taken = [(robot.x_m, robot.y_m)]
        for track in sorted(around.tracks, key=lambda track: -track.probability):
            place = (track.x_m, track.y_m)
            # two robots cannot be in one place: the less probable one is not there
            if any(math.dist(place, other) < _APART_RADII * self._limits.radius_m for other in taken):
                continue
            taken.append(place)
            away = math.hypot(track.x_m - robot.x_m, track.y_m - robot.y_m)
            t = around.age_s + min(ahead_s, away / self._limits.speed_mps)
            covariance = track.covariance[:2, :2] + t**2 * track.covariance[2:, 2:]
            discs[track.number] = Disc(*track.place_after(t), self._limits.radius_m, covariance)
        return discs

    def _way(self, here: Point, target: Point, others: Mapping[int, Disc]) -> _Way:
        """Choose between the gaps of the first row that stands across the straight way."""
        row = row_across(here, target, others, self._field, self._limits.radius_m)
        if row is None:
            self._taken = None
            return _Way((target,), None, Reason("gap", "straight", "nobody stands in the way"))
        return self._gate(here, target, row) or self._choose(here, target, row)

    def _gate(self, here: Point, target: Point, row: Row) -> _Way | None:
        """Ask the gate planner where the straight way leads between two whose gap may be too narrow."""
        straight = row.straight
        gap, needed_m = row.gaps[straight], self._times.narrowest_m
        if min(row.keys[straight]) < 0 or not _NARROW < gap.wide_enough(needed_m) < _WIDE:
            return None
        rest = [k for k in range(len(row.gaps)) if k != straight]
        detour = rest[choose_gap(self._times, here, target, [row.gaps[k] for k in rest]).index]
        # wide enough is what can be passed at a safe speed
        gates = GatePlanner(self._motion, WidthSensor(), needed_m)
        plan = gates.plan(here, gap, target, [row.gaps[detour].center_m])
        if plan.action == "look" and plan.viewpoint_m is not None:
            self._taken = row.keys[straight]
            waits = math.dist(plan.viewpoint_m, here) < _HERE_M
            there = gap.center_m if waits else plan.viewpoint_m
            why = Reason("gap", "look first", plan.reason)
            return _Way((there, gap.center_m, target), row.ends[straight], why, waits)
        taken, choice = (straight, "through") if plan.action == "pass" else (detour, "detour")
        self._taken = row.keys[taken]
        return _Way(_through(here, target, row.gaps[taken]), row.ends[taken], Reason("gap", choice, plan.reason))

    def _choose(self, here: Point, target: Point, row: Row) -> _Way:
        """Take the gap with the least expected time, and stay with it."""
        chosen = choose_gap(self._times, here, target, row.gaps)
        index, text = chosen.index, chosen.reason
        if self._taken in row.keys:
            kept = row.keys.index(self._taken)
            if kept != index and chosen.expected_s[kept] < chosen.expected_s[index] + _BETTER_S:
                gap = row.gaps[kept]
                index = kept
                text = f"gap {gap.width_m:.2f} m, sigma {gap.sigma_m:.2f} m: as before, no other saves {_BETTER_S} s"
        self._taken = row.keys[index]
        choice = "through" if index == row.straight else "detour"
        return _Way(_through(here, target, row.gaps[index]), row.ends[index], Reason("gap", choice, text))

    @property
    def _times(self) -> PassageTimes:
        return _passage_times(self._limits)

    def _speed(self, path: FloatArray, around: Surroundings, others: Sequence[Disc]) -> tuple[float, Reason]:
        """Return the largest speed that is safe among whom one knows, and over floor that is not decided yet."""
        ahead = unit(tuple(path[0].tolist()), tuple(path[1].tolist()))
        target = tuple(path[-1].tolist())
        # who is left behind is no danger
        before = [
            d
            for d in others
            if in_way(d, tuple(path[0].tolist()), ahead)[0] > 0 and math.dist((d.x_m, d.y_m), target) > _AT_TARGET_M
        ]
        known = self._speeds.plan(
            path, around.robot.pose, around.robot.covariance, around.velocity_mps, before, around.pending_mps
        )
        speed, why = _paced(known, "opponents")
        floor = self._floor(around)
        if floor is not None:
            unknown = self._undecided.plan(path, floor)
            if unknown.speed_mps < speed:
                speed, why = _paced(unknown, "undecided floor")
        return speed, why

    def _floor(self, around: Surroundings) -> UndecidedFloor | None:
        """Return what is not decided; what is blocked, steering sees as well."""
        if around.floor is None:
            return None
        looks = np.where(around.floor.state.T == UNDECIDED, self._looks, FREE)
        robot = around.robot.pose
        # who is followed is no undecided floor, though the map leaves it out
        side = (np.arange(looks.shape[0]) + 0.5) * around.floor.cell_m
        x, y = around.floor.corner_m[0] + side, around.floor.corner_m[1] + side[:, None]
        reach = 2 * self._limits.radius_m
        for disc in [*((t.x_m, t.y_m) for t in around.tracks), (robot.x_m, robot.y_m)]:
            looks[np.hypot(x - disc[0], y - disc[1]) < reach] = FREE
        # beyond the walls nobody drives
        if self._field.is_bounded:
            looks[(np.abs(x) > self._field.length_m / 2) | (np.abs(y) > self._field.width_m / 2)] = FREE
        return UndecidedFloor(looks, around.floor.corner_m, around.floor.cell_m)


def _motion(limits: RobotLimits) -> MotionLimits:
    return MotionLimits(limits.speed_mps, limits.acceleration_mps2, limits.dead_time_s)


def _speed_planner(limits: RobotLimits) -> SpeedPlanner:
    look = np.diag([_POSE_STD_M**2, _POSE_STD_M**2, _POSE_STD_RAD**2])
    noise = PoseNoise(_ODOMETRY_SHARE, _ODOMETRY_SHARE, look)
    return SpeedPlanner(PathFollower(_motion(limits)), limits.radius_m, noise, _REPLAN_S)


@functools.lru_cache(maxsize=4)
def _passage_times(limits: RobotLimits) -> PassageTimes:
    """Return the same table for all robots that are alike: it takes a second to make."""
    return PassageTimes(_speed_planner(limits), limits.radius_m, _OTHERS_STD_M)


def _paced(plan: SpeedPlan, what: str) -> tuple[float, Reason]:
    if not plan.safe or plan.speed_mps < _CREEP_MPS:
        return _CREEP_MPS, Reason("speed", f"creep: {what}", plan.reason)
    if plan.reason.startswith("full speed"):
        return plan.speed_mps, Reason("speed", "full speed", plan.reason)
    return plan.speed_mps, Reason("speed", f"slow: {what}", plan.reason)


def _through(here: Point, target: Point, gap: Gap) -> tuple[Point, ...]:
    return (gap.center_m, target) if math.dist(here, gap.center_m) > _SAME_M else (target,)


def _std(disc: Disc) -> float:
    return math.sqrt(max(disc.variance_m2, 0.0))
