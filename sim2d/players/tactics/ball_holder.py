"""Decisions of a player with the ball in its mouth: shoot, clear, dribble."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.planning.shots.shot_planner import ShotPlan
from sim2d.players.plan import Plan, Situation
from sim2d.players.tactics.team_field import KEEPER_LINE_RADII, TeamField, direction_rad, offset
from sim2d.robot_link import Point, Reason, RobotLimits

# Number of places tested in the goal's mouth: less than a ball apart, and odd to include the middle.
_PLACES = 21
# Reaction time of other robots after a kick.
REACTION_S = 0.3
# `_MIN_AIM_RAD` is about the scatter of kicks: a shot must be open by at least that to either side. The aim may
# be off by half of the open angle, but at least by the smaller angle; if the shot is not open, by the larger one.
_MAX_AIM_RAD = 0.35
_MIN_AIM_RAD = 0.06
# Distance, in radii, of another robot at which the ball is soon lost: a keeper clears it, others act quickly.
_PRESSED_RADII = 3.0
# Least cosine of the heading for clearing, so that no kick goes to the own goal.
_MIN_FORWARD_COS = 0.3
# Least probability of a goal by a planned shot.
_MIN_CHANCE = 0.05
# Times after which a ball that is kept from the goal by others or a wall is shot in any case, and is kicked in any
# direction, because opponents end longer holds. Without obstacles the time for the way is added.
_MAX_HELD_S = 3.0
_CLEAR_AFTER_S = 4.5
# Length of a step of dribbling: long enough to gain speed, short enough to react.
_MAX_STEP_M = 0.4
_MIN_STEP_M = 0.15
# It draws back before a turn by more than this with less room ahead, which would wedge the ball against a wall.
_TURN_RAD = 0.6
_TURN_ROOM_REACHES = 1.5
# Distance of drawing back.
_DRAW_BACK_M = 0.3


class BallHolder:
    """Decides for one player that holds the ball.

    Parameters
    ----------
    is_keeper : bool
        A keeper clears the ball under pressure and shoots from any distance.
    """

    def __init__(self, team: TeamField, limits: RobotLimits, is_keeper: bool) -> None:
        self._team, self._is_keeper, self._limits = team, is_keeper, limits
        self._kick_speed_mps = limits.kick_speed_mps

    def decide(self, now: Situation) -> Plan:
        """Turn the ball towards the opponent's goal; kick it there, or to a free place."""
        pose = now.pose
        ball = self._team.mouth(pose)
        if now.shot is not None:
            planned = self._follow(now, ball, now.shot)
            if planned is not None:
                return planned
        if self._is_keeper and self._is_pressed(now):
            return self._kick("clear", ball, pose.theta_rad)
        target, open_rad = self._aim(pose, ball, now.obstacles)
        wanted = direction_rad(now.place, target)
        off = abs(wrap_angle(wanted - pose.theta_rad))
        if open_rad > _MIN_AIM_RAD and off < max(_MIN_AIM_RAD, 0.5 * open_rad):
            return self._kick("shoot", ball, wanted)
        is_stopped = self._is_stopped(ball, now.obstacles)
        if is_stopped and now.held_s > _MAX_HELD_S and off < _MAX_AIM_RAD:
            return self._kick("shoot", ball, wanted)
        away, goal_half = math.dist(ball, target), self._team.goal_half_m
        if now.held_s > _CLEAR_AFTER_S + (0.0 if is_stopped else away / self._limits.speed_mps):
            # held too long, in a corner or a scrum: any direction is better
            return self._kick("clear", ball, pose.theta_rad)
        # players that plan their speed drive faster, and need a longer way to stop
        farthest = _MAX_STEP_M if now.shot is None else self._limits.speed_mps**2 / self._limits.acceleration_mps2
        step = min(max(farthest, _MAX_STEP_M), max(away - 2 * goal_half, _MIN_STEP_M))
        return self._dribble(pose, offset(now.place, wanted, step), wanted)

    def _is_pressed(self, now: Situation) -> bool:
        """Whether another robot is so near that the ball is soon lost, and a kick would go forward."""
        near_m = _PRESSED_RADII * self._team.robot_radius_m
        is_forward = math.cos(now.pose.theta_rad) > _MIN_FORWARD_COS
        return is_forward and any(math.dist(other, now.place) < near_m for other in now.others)

    def _is_stopped(self, ball: Point, obstacles: tuple[Point, ...]) -> bool:
        """Whether the ball cannot advance: another robot or a wall is near, or the holder is the keeper."""
        team = self._team
        near_m = _PRESSED_RADII * team.robot_radius_m
        is_at_wall = team.is_near_wall(ball, _TURN_ROOM_REACHES * team.reach_m)
        return self._is_keeper or is_at_wall or any(math.dist(other, ball) < near_m for other in obstacles)

    def _aim(self, pose: Pose2, ball: Point, obstacles: tuple[Point, ...]) -> tuple[Point, float]:
        """Return the place in the goal's mouth with the most open way, or the middle, and its `_open_rad`.

        A keeper only has to kick past the nearest robots: it takes the least turn to an open way to the end line.
        """
        team = self._team
        # obstacles near the goal line are posts and nets
        others = [one for one in obstacles if one[0] < team.half_length_m - team.robot_radius_m]
        keeper = team.half_length_m - KEEPER_LINE_RADII * team.robot_radius_m, 0.0
        is_seen = any(math.dist(one, keeper) < team.goal_half_m + team.robot_radius_m for one in others)
        if not (is_seen or self._is_keeper):
            others.append(keeper)
        width_m = (team.half_width_m if self._is_keeper else team.mouth_half_m) - team.ball_radius_m
        places = [(team.half_length_m, y) for y in np.linspace(-width_m, width_m, _PLACES).tolist()]
        opens = {place: self._open_rad(ball, place, others) for place in places}
        best = max(places, key=opens.__getitem__)
        if self._is_keeper:
            free = [place for place in places if opens[place] > _MIN_AIM_RAD]
            best = min(free or [best], key=lambda p: abs(wrap_angle(direction_rad(ball, p) - pose.theta_rad)))
        if opens[best] <= 0.0:
            return (team.half_length_m, 0.0), 0.0
        return best, opens[best]

    def _open_rad(self, ball: Point, place: Point, others: list[Point]) -> float:
        """Return the greatest error of a shot at a place, to either side, that no post or running robot stops."""
        team, way_rad, open_rad = self._team, direction_rad(ball, place), _MAX_AIM_RAD
        if not self._is_keeper:
            half_m = team.mouth_half_m - team.ball_radius_m
            posts = ((team.half_length_m, half_m), (team.half_length_m, -half_m))
            open_rad = min(abs(wrap_angle(direction_rad(ball, post) - way_rad)) for post in posts)
        c, s = math.cos(way_rad), math.sin(way_rad)
        for x, y in others:
            off_x, off_y = x - ball[0], y - ball[1]
            along_m, aside_m = c * off_x + s * off_y, abs(c * off_y - s * off_x)
            if along_m <= 0.0:
                continue
            run_s = 0.0 if self._is_keeper else along_m / self._kick_speed_mps - REACTION_S
            reach_m = team.reach_m + dash_m(run_s, self._limits)
            open_rad = min(open_rad, math.atan2(aside_m - reach_m, along_m))
        return open_rad

    def _follow(self, now: Situation, ball: Point, shot: ShotPlan) -> Plan | None:
        """Kick, turn or approach as in the shot plan; None if its probability is small."""
        if shot.chance < _MIN_CHANCE or now.held_s > _MAX_HELD_S:
            return None
        why = Reason("shot", shot.action, shot.reason)
        if shot.action == "kick":
            return self._kick("shoot", ball, now.pose.theta_rad, why)
        target = offset(shot.place_m, shot.heading_rad, -self._team.reach_m)
        return self._dribble(now.pose, target, shot.heading_rad, why)

    def _kick(self, intent: str, ball: Point, heading_rad: float, why: Reason | None = None) -> Plan:
        target = self._team.inside(ball)
        return Plan(intent, target, heading_rad, self._kick_speed_mps, True, close=True, holding=True, why=why)

    def _dribble(self, pose: Pose2, target: Point, wanted_rad: float, why: Reason | None = None) -> Plan:
        """Take the ball to a place; draw back first if turning would wedge it between robot and wall."""
        team = self._team
        is_small_turn = abs(wrap_angle(wanted_rad - pose.theta_rad)) <= _TURN_RAD
        if is_small_turn or team.room_ahead_m(pose) >= _TURN_ROOM_REACHES * team.reach_m:
            return Plan("dribble", team.inside(target), wanted_rad, dribble=True, holding=True, why=why)
        back = pose.compose(Pose2(-_DRAW_BACK_M, 0.0, 0.0))
        place = team.inside((back.x_m, back.y_m))
        return Plan("draw back", place, pose.theta_rad, dribble=True, close=True, holding=True, why=why)


def dash_m(time_s: float, limits: RobotLimits) -> float:
    """Return the distance that a robot covers from rest in a time."""
    speed, acceleration = limits.speed_mps, limits.acceleration_mps2
    faster_s = min(max(time_s, 0.0), speed / acceleration)
    return acceleration * faster_s**2 / 2 + speed * max(time_s - faster_s, 0.0)
