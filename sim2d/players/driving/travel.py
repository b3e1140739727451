"""Plans way and speed of a player to its target, with reasons, by the planners of gaps, speeds and undecided floor.

Everything is in the field frame.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray
from robocup_vision.mapping.occupancy import UNDECIDED
from robocup_vision.planning import Disc, SpeedPlan
from robocup_vision.planning.speed.undecided_floor import FREE, UndecidedFloor, UndecidedSpeed, safe_speed_mps
from sim2d.players.driving.route import HERE_M, REPLAN_S, RoutePlanner, in_way, speed_planner, unit
from sim2d.players.plan import Surroundings
from sim2d.robot_link import CONTROL_PERIOD_S, Point, Reason, RobotLimits

# mean distance over which a ball is carried before a kick
_SHORT_M = 0.35
# Greatest motion of a target that keeps its plan.
_SAME_M = 0.06
# Greatest time for which other robots are predicted, because their velocities change.
_AHEAD_S = 0.6
# Length of a way, in robot radii, that is left to steering, because a keeper must be quick.
_SHORT_RADII = 3.5
# Robots this near to the target are ignored until this one is near.
_AT_TARGET_M = 0.35
# Greatest speed of a robot that counts as standing.
_STANDS_MPS = 0.25
# Greatest distance of a ball from the rim of the robot that has it.
_TAKEN_M = 0.04
# Distance to keep from that robot.
_ROOM_M = 0.06
# Least speed of all plans, also if no speed is safe.
_CREEP_MPS = 0.2
# Greatest acceleration of a ball that turns with the robot: half of that of a dribbler's pull.
_HOLD_MPS2 = 3.0


@dataclass(frozen=True, slots=True)
class Travel:
    """A planned way to a target."""

    #: First place to drive to.
    waypoint: Point
    #: Speed limit.
    speed_mps: float
    #: Ends of the chosen gap, field frame.
    gap: tuple[Point, Point] | None
    #: Reasons of the choice.
    reasons: tuple[Reason, ...]
    #: Whether the drive ends at the waypoint for now.
    ends_there: bool = False
    #: Limit of the turning rate.
    turn_rps: float = math.inf
    #: Whether others may be touched, close to the ball and with it.
    presses: bool = False


class TravelPlanner:
    """Plans the ways of one player.

    Parameters
    ----------
    looks : int
        Number of frames that decide a cell of the floor.
    """

    def __init__(self, field: Field, limits: RobotLimits, looks: int) -> None:
        self._field, self._limits, self._looks = field, limits, looks
        self._routes = RoutePlanner(field, limits)
        self._speeds = speed_planner(limits)
        self._undecided = UndecidedSpeed(limits, limits.radius_m, REPLAN_S)
        self._last: tuple[float, Point, Travel] | None = None

    def plan(self, surroundings: Surroundings, target: Point) -> Travel:
        """Plan a way to a target; within `REPLAN_S` of the last plan, that one is kept."""
        if self._last is not None:
            planned_s, there, travel = self._last
            if 0 <= surroundings.t_s - planned_s < REPLAN_S and math.dist(there, target) < _SAME_M:
                return travel if travel.gap is not None else replace(travel, waypoint=target)
        travel = self._replan(surroundings, target)
        self._last = (surroundings.t_s, target, travel)
        return travel

    def approach(self, surroundings: Surroundings, target: Point, ball: Point | None) -> Travel:
        """Plan the last part of the way to a ball: straight, at a speed at which the robot can stop before others.

        If another robot has the ball and is between it and this robot, this robot keeps away. `ball` may be unknown.
        """
        here = surroundings.here
        way = unit(here, target)
        self._forget()
        others = list(surroundings.others(self._limits, 0.0).values())
        holder = None if ball is None else self._holder(here, others, ball)
        if holder is not None:
            ring_m = holder.radius_m + self._limits.radius_m + _ROOM_M
            away_m = math.dist(here, (holder.x_m, holder.y_m))
            if away_m < ring_m + HERE_M:
                out = unit((holder.x_m, holder.y_m), here)
                place = (holder.x_m + ring_m * out[0], holder.y_m + ring_m * out[1])
                text = f"{away_m - ring_m + _ROOM_M:.2f} m from a robot that has the ball"
                return Travel(place, self._limits.speed_mps, None, (Reason("speed", "leave room", text),), True)
        room = math.inf
        for disc in others:
            along, aside = in_way(disc, here, way)
            touch = disc.radius_m + self._limits.radius_m
            if along > 0 and abs(aside) < touch:
                room = min(room, along - math.sqrt(touch**2 - aside**2) - _std(disc))
        if room == math.inf:
            return Travel(
                target, self._limits.speed_mps, None, (Reason("speed", "full speed", "no robot at the ball"),)
            )
        speed = safe_speed_mps(room, 1, CONTROL_PERIOD_S, self._limits)
        if speed >= self._limits.speed_mps:
            return Travel(target, speed, None, (Reason("speed", "full speed", f"opponent in {room:.2f} m"),))
        speed = max(speed, _CREEP_MPS / 2)
        text = f"{speed:.2f} m/s: opponent in {max(room, 0.0):.2f} m at the ball"
        return Travel(target, speed, None, (Reason("speed", "slow: at the ball", text),))

    def race(self, target: Point) -> Travel:
        """Return the way to a ball for which robots race: straight, at full speed."""
        return self._at_full_speed(target, "to the ball", math.inf)

    def carry(self, target: Point) -> Travel:
        """Return the way with the ball: at full speed, with the greatest turning rate that does not lose the ball."""
        return self._at_full_speed(target, "with the ball", self.holding_rps)

    @property
    def holding_rps(self) -> float:
        """Greatest turning rate without losing the ball in the mouth."""
        reach_m = self._limits.radius_m + self._field.ball_radius_m
        return min(math.sqrt(_HOLD_MPS2 / reach_m), self._limits.turn_rps)

    @property
    def holding_mps(self) -> float:
        """Mean speed of the ball over a short way from rest."""
        return min(math.sqrt(self._limits.acceleration_mps2 * _SHORT_M / 2), self._limits.speed_mps)

    def _at_full_speed(self, target: Point, why: str, turn_rps: float) -> Travel:
        self._forget()
        reason = Reason("speed", "full speed", why)
        return Travel(target, self._limits.speed_mps, None, (reason,), turn_rps=turn_rps, presses=True)

    def _holder(self, here: Point, others: Sequence[Disc], ball: Point) -> Disc | None:
        """Return the robot that has the ball, if it is between the ball and this robot."""
        nearest = min(others, key=lambda disc: math.dist((disc.x_m, disc.y_m), ball), default=None)
        if nearest is None:
            return None
        away_m = math.dist((nearest.x_m, nearest.y_m), ball)
        reach_m = nearest.radius_m + self._field.ball_radius_m + _TAKEN_M
        to_ball, to_robot = (unit((nearest.x_m, nearest.y_m), place) for place in (ball, here))
        is_behind = to_ball[0] * to_robot[0] + to_ball[1] * to_robot[1] < 0.0
        return nearest if away_m < reach_m and is_behind else None

    def _replan(self, surroundings: Surroundings, target: Point) -> Travel:
        here = surroundings.here
        if math.dist(here, target) < _SHORT_RADII * self._limits.radius_m:
            self._routes.forget()
            full = Reason("speed", "full speed", "the way is short")
            return Travel(target, self._limits.speed_mps, None, (full,))
        others = surroundings.others(self._limits, _AHEAD_S)
        way = self._routes.plan(here, target, others)
        path = np.array([here, *way.points])
        # the planner of speeds uses standing obstacles; steering avoids moving ones
        moving = {t.number for t in surroundings.tracks if math.hypot(t.vx_mps, t.vy_mps) > _STANDS_MPS}
        speed, why = self._speed(path, surroundings, [disc for number, disc in others.items() if number not in moving])
        if way.waits:
            speed, why = _CREEP_MPS, Reason("speed", "slow: to look", f"{_CREEP_MPS:.2f} m/s: {way.reason.text}")
        return Travel(way.points[0], speed, way.ends, (way.reason, why))

    def _speed(self, path: FloatArray, surroundings: Surroundings, others: Sequence[Disc]) -> tuple[float, Reason]:
        """Return the greatest safe speed among known robots and over undecided floor."""
        ahead = unit(tuple(path[0].tolist()), tuple(path[1].tolist()))
        target = tuple(path[-1].tolist())
        # robots behind this one are ignored
        before = [
            d
            for d in others
            if in_way(d, tuple(path[0].tolist()), ahead)[0] > 0 and math.dist((d.x_m, d.y_m), target) > _AT_TARGET_M
        ]
        known = self._speeds.plan(
            path,
            surroundings.robot.pose,
            surroundings.robot.covariance,
            surroundings.velocity_mps,
            before,
            surroundings.pending_mps,
        )
        speed, why = self._paced(known, "opponents")
        floor = self._floor(surroundings)
        if floor is not None:
            unknown = self._undecided.plan(path, floor)
            if unknown.speed_mps < speed:
                speed, why = self._paced(unknown, "undecided floor")
        return speed, why

    def _floor(self, surroundings: Surroundings) -> UndecidedFloor | None:
        """Return the undecided cells; blocked ones are obstacles for steering."""
        if surroundings.floor is None:
            return None
        looks = np.where(surroundings.floor.state.T == UNDECIDED, self._looks, FREE)
        robot = surroundings.robot.pose
        # tracked robots are not undecided floor, although the map does not contain them
        side = (np.arange(looks.shape[0]) + 0.5) * surroundings.floor.cell_m
        x, y = surroundings.floor.corner_m[0] + side, surroundings.floor.corner_m[1] + side[:, None]
        reach = 2 * self._limits.radius_m
        for disc in [*((t.x_m, t.y_m) for t in surroundings.tracks), (robot.x_m, robot.y_m)]:
            looks[np.hypot(x - disc[0], y - disc[1]) < reach] = FREE
        # cells beyond the walls do not matter
        if self._field.is_bounded:
            looks[(np.abs(x) > self._field.length_m / 2) | (np.abs(y) > self._field.width_m / 2)] = FREE
        return UndecidedFloor(looks, surroundings.floor.corner_m, surroundings.floor.cell_m)

    def _paced(self, plan: SpeedPlan, what: str) -> tuple[float, Reason]:
        """Return a plan's speed and its reason."""
        if not plan.safe or plan.speed_mps < _CREEP_MPS:
            return _CREEP_MPS, Reason("speed", f"creep: {what}", plan.reason)
        if plan.reason.startswith("full speed"):
            return plan.speed_mps, Reason("speed", "full speed", plan.reason)
        return plan.speed_mps, Reason("speed", f"slow: {what}", plan.reason)

    def _forget(self) -> None:
        self._last = None
        self._routes.forget()


def _std(disc: Disc) -> float:
    return math.sqrt(max(disc.variance_m2, 0.0))
