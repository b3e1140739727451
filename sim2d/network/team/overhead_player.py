"""Plays one robot of a team with overhead vision.

Tactics, paths, speeds and shots are planned as by the built-in planning players, but places and velocities come from
overhead vision instead of the robot's own camera. All places are in the team's frame (the opponent's goal at +x).
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from field_models import Field
from robocup_vision.arrays import FloatArray
from robocup_vision.belief import MapPicture, Track
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.mapping.occupancy import FREE
from robocup_vision.perception.free_space import FreeSpace
from robocup_vision.planning import ShotPlan
from sim2d.match.pitch_rules import defence_area
from sim2d.players.ball import block_ball
from sim2d.players.driving.motion import Motion, MotionSettings
from sim2d.players.driving.travel import Travel, TravelPlanner
from sim2d.players.keep_out import Area, KeepOut, allowed_target, block_zones, ranges_to_segments
from sim2d.players.plan import Plan, Situation, Surroundings
from sim2d.players.shot import Shooter
from sim2d.players.tactics.tactics import Tactics
from sim2d.robot_link import CONTROL_PERIOD_S, Command, Point, RobotLimits

_DIRECTIONS = 80
# covariances of overhead vision: the robot's place and heading, and others' places and velocities
_POSE_COV = np.diag([0.002**2, 0.002**2, 0.01**2])
_TRACK_COV = np.diag([0.003**2, 0.003**2, 0.05**2, 0.05**2])
# only robots within this distance matter for a decision: two robots that brake need half of it
_NEAR_M = 2.0
# cell size of the map, on which all floor is known and free
_CELL_M = 0.1


@dataclass(frozen=True, slots=True)
class Moving:
    """A moving robot, team frame: its number as an obstacle, pose and velocities."""

    number: int
    pose: Pose2
    velocity_mps: Point
    turn_rps: float


@dataclass(frozen=True, slots=True)
class Orders:
    """The team's orders for one of its robots."""

    tactics: Tactics  #: tactics of its present role
    keep_outs: tuple[KeepOut, ...] = ()  #: areas it must not enter, besides those of its tactics
    goes_to: Point | None = None  #: where it drives to leave the game; None: it plays


class OverheadPlayer:
    """Decides for one robot.

    Parameters
    ----------
    seed : int
        Seed for the directions in which it tries to get free when it is stuck.
    """

    def __init__(self, field: Field, limits: RobotLimits, motion: MotionSettings, seed: int) -> None:
        self._field, self._limits = field, limits
        self._motion = Motion(limits, np.random.default_rng(seed), motion)
        self._holding = motion.holding_mps, motion.holding_rps
        self._planner = TravelPlanner(field, limits, 1)
        self._shooter = Shooter(field, limits, 1, motion=motion)
        self._bearing_rad: FloatArray = np.linspace(-math.pi, math.pi, 2 * _DIRECTIONS + 1)[1::2].astype(np.float64)
        reach_x_m, reach_y_m = np.abs(field.floor_polygon).max(axis=0).tolist()
        self._floor = MapPicture(
            np.full((math.ceil(2 * reach_x_m / _CELL_M), math.ceil(2 * reach_y_m / _CELL_M)), FREE, dtype=np.uint8),
            (-reach_x_m, -reach_y_m),
            _CELL_M,
        )
        goal = field.goals[0]
        self._fixed: tuple[KeepOut, ...] = tuple(
            Area((min(x, x + side), -goal.width_m / 2 - 0.03), (max(x, x + side), goal.width_m / 2 + 0.03))
            for side in (1, -1)
            for x in (side * (field.length_m / 2 + 0.01),)
        )
        self._held_since_s: float | None = None
        self.intent = ""

    def act(self, orders: Orders, now: Situation, me: Moving, others: tuple[Moving, ...]) -> Command:
        """Return the robot's command for the next control period.

        Parameters
        ----------
        now : Situation
            What is common to the team's robots; pose, time of holding the ball, shot and others are filled in here.
        me : Moving
            The robot at the time when the command takes effect.
        """
        pose, limits = me.pose, self._limits
        c, s = math.cos(pose.theta_rad), math.sin(pose.theta_rad)
        forward, left = c * me.velocity_mps[0] + s * me.velocity_mps[1], c * me.velocity_mps[1] - s * me.velocity_mps[0]
        step = Pose2(forward * CONTROL_PERIOD_S, left * CONTROL_PERIOD_S, me.turn_rps * CONTROL_PERIOD_S)
        self._motion.update(step, now.t_s)
        tracks = tuple(
            Track(o.number, o.pose.x_m, o.pose.y_m, *o.velocity_mps, _TRACK_COV, 1.0, 100, 0) for o in others
        )
        around = Surroundings(
            now.t_s, PoseEstimate(pose, _POSE_COV, 1.0, 0.0), me.velocity_mps, me.velocity_mps, tracks, 0.0, None
        )
        places = tuple((o.pose.x_m, o.pose.y_m) for o in others)
        situation = dataclasses.replace(
            now,
            pose=pose,
            held_s=self._held_s(now),
            obstacles=places,
            others=places,
            shot=self._shot(now, around, me) if not orders.tactics.is_keeper else None,
        )
        plan = self._plan(orders, situation)
        self.intent = plan.intent
        radius_m = limits.radius_m
        zones = tuple(
            zone
            for zone in (*self._fixed, *orders.keep_outs, *plan.keep_outs)
            if min(zone.signed_distance_m(situation.place), zone.signed_distance_m(plan.target)) < _NEAR_M
        )
        plan = dataclasses.replace(plan, target=allowed_target(plan.target, situation.place, zones, radius_m))
        corners = pose.inverse().transform(self._field.floor_polygon)
        free = FreeSpace(self._bearing_rad, ranges_to_segments(self._bearing_rad, corners))
        free = block_zones(free, pose, zones, radius_m)
        if plan.avoid_ball and now.ball is not None:
            at = pose.inverse().transform(now.ball)
            free = block_ball(free, (float(at[0]), float(at[1])), self._field.ball_radius_m)
        near = [t for t in tracks if math.dist((t.x_m, t.y_m), situation.place) < _NEAR_M]
        moving = tuple(track.as_disc(pose, radius_m) for track in near)
        return self._motion.drive(plan, pose, free, now.t_s, moving, self._travel(plan, around, now.ball))

    def _plan(self, orders: Orders, now: Situation) -> Plan:
        if orders.goes_to is None:
            return orders.tactics.decide(now)
        return Plan("leave the field", orders.goes_to, now.pose.theta_rad, avoid_ball=True)

    def _held_s(self, now: Situation) -> float:
        if not now.in_mouth:
            self._held_since_s = None
            return 0.0
        if self._held_since_s is None:
            self._held_since_s = now.t_s
        return now.t_s - self._held_since_s

    def _shot(self, now: Situation, around: Surroundings, me: Moving) -> ShotPlan | None:
        if not now.in_mouth:
            return None
        return self._shooter.plan(dataclasses.replace(around, floor=self._floor), me.turn_rps)

    def _travel(self, plan: Plan, around: Surroundings, ball: Point | None) -> Travel:
        if plan.holding:
            carried, holding = self._planner.carry(plan.target), self._holding
            speed_mps, turn_rps = min(carried.speed_mps, holding[0]), min(carried.turn_rps, holding[1])
            return dataclasses.replace(carried, speed_mps=speed_mps, turn_rps=turn_rps, presses=False)
        if plan.close:
            return self._planner.approach(around, plan.target, ball)
        return self._planner.plan(around, plan.target)


def defence_zones(field: Field, *, is_keeper: bool, their_room_m: float) -> tuple[KeepOut, ...]:
    """Return the defence areas that a robot keeps out of, team frame; a keeper may be in its own.

    The opponents' area is enlarged by `their_room_m`.
    """
    area = defence_area(field)
    if area is None:
        return ()
    front, half, back = area.line_x_m - area.depth_m, area.width_m / 2, area.line_x_m + 1.0
    theirs = Area((front - their_room_m, -half - their_room_m), (back, half + their_room_m))
    own = Area((-back, -half), (-front, half))
    return (theirs,) if is_keeper else (theirs, own)
