"""Decisions of a player with the ball in its mouth: shoot, clear, dribble."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.planning.shots.shot_planner import ShotPlan
from sim2d.players.plan import Plan, Situation
from sim2d.players.tactics.keeper import KeeperSettings
from sim2d.players.tactics.team_field import TeamField, direction_rad, offset
from sim2d.robot_link import Point, Reason, RobotLimits


@dataclass(frozen=True, slots=True)
class BallHolderSettings:
    """Values of `BallHolder`; lengths in radii are robot radii unless the line names ball radii."""

    #: Number of places tested in the goal's mouth: less than a ball apart, and odd to include the middle.
    places: int = 21
    #: Reaction time of a robot in the shot's way.
    reaction_s: float = 0.3
    #: The smaller angle is about the scatter of kicks: a shot must be open by at least that to either side. The aim may
    #: be off by half of the open angle, but at least by the smaller angle; if the shot is not open, by the larger one.
    max_aim_rad: float = 0.35
    min_aim_rad: float = 0.06
    #: Distance, in radii, of another robot at which the ball is soon lost: a keeper clears it, others act quickly.
    pressed_radii: float = 3.0
    #: Least cosine of the heading for clearing, so that no kick goes to the own goal.
    min_forward_cos: float = 0.3
    #: Least probability of a goal by a planned shot.
    min_chance: float = 0.05
    #: Times after which a ball that is kept from the goal by others or a wall is shot in any case, and is kicked in any
    #: direction, because opponents end longer holds. Without obstacles the time for the way is added.
    max_held_s: float = 3.0
    clear_after_s: float = 4.5
    #: Length of a step of dribbling: long enough to gain speed, short enough to react.
    max_step_m: float = 0.4
    min_step_m: float = 0.15
    #: It draws back before a turn by more than this with less room ahead, which would wedge the ball against a wall.
    turn_rad: float = 0.6
    turn_room_reaches: float = 1.5
    #: Distance of drawing back.
    draw_back_m: float = 0.3


class BallHolder:
    """Decides for one player that holds the ball.

    Parameters
    ----------
    is_keeper : bool
        A keeper clears the ball under pressure and shoots from any distance.
    keeper : KeeperSettings
        Place assumed for an unseen keeper.
    """

    def __init__(
        self,
        team: TeamField,
        limits: RobotLimits,
        is_keeper: bool,
        settings: BallHolderSettings,
        keeper: KeeperSettings,
    ) -> None:
        self._team, self._is_keeper, self._settings = team, is_keeper, settings
        self._kick_speed_mps, self._limits, self._keeper = limits.kick_speed_mps, limits, keeper

    def decide(self, now: Situation) -> Plan:
        """Turn the ball towards the opponent's goal; kick it there, or to a free place."""
        settings, pose = self._settings, now.pose
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
        if open_rad > settings.min_aim_rad and off < max(settings.min_aim_rad, 0.5 * open_rad):
            return self._kick("shoot", ball, wanted)
        is_stopped = self._is_stopped(ball, now.obstacles)
        if is_stopped and now.held_s > settings.max_held_s and off < settings.max_aim_rad:
            return self._kick("shoot", ball, wanted)
        away, goal_half = math.dist(ball, target), self._team.goal_half_m
        if now.held_s > settings.clear_after_s + (0.0 if is_stopped else away / self._limits.speed_mps):
            # held too long, in a corner or a scrum: any direction is better
            return self._kick("clear", ball, pose.theta_rad)
        # players that plan their speed drive faster, and need a longer way to stop
        farthest = (
            settings.max_step_m if now.shot is None else self._limits.speed_mps**2 / self._limits.acceleration_mps2
        )
        step = min(max(farthest, settings.max_step_m), max(away - 2 * goal_half, settings.min_step_m))
        return self._dribble(pose, offset(now.place, wanted, step), wanted)

    def _is_pressed(self, now: Situation) -> bool:
        """Whether another robot is so near that the ball is soon lost, and a kick would go forward."""
        near_m = self._settings.pressed_radii * self._team.robot_radius_m
        is_forward = math.cos(now.pose.theta_rad) > self._settings.min_forward_cos
        return is_forward and any(math.dist(other, now.place) < near_m for other in now.others)

    def _is_stopped(self, ball: Point, obstacles: tuple[Point, ...]) -> bool:
        """Whether the ball cannot advance: another robot or a wall is near, or the holder is the keeper."""
        team, settings = self._team, self._settings
        near_m = settings.pressed_radii * team.robot_radius_m
        is_at_wall = team.is_near_wall(ball, settings.turn_room_reaches * team.reach_m)
        return self._is_keeper or is_at_wall or any(math.dist(other, ball) < near_m for other in obstacles)

    def _aim(self, pose: Pose2, ball: Point, obstacles: tuple[Point, ...]) -> tuple[Point, float]:
        """Return the place in the goal's mouth with the most open way, or the middle, and its `_open_rad`.

        A keeper only has to kick past the nearest robots: it takes the least turn to an open way to the end line.
        """
        team, settings = self._team, self._settings
        # posts and nets are not robots
        others = [one for one in obstacles if one[0] < team.half_length_m - team.robot_radius_m]
        keeper = team.half_length_m - self._keeper.line_radii * team.robot_radius_m, 0.0
        is_seen = any(math.dist(one, keeper) < team.goal_half_m + team.robot_radius_m for one in others)
        if not (is_seen or self._is_keeper):
            others.append(keeper)
        width_m = (team.half_width_m if self._is_keeper else team.mouth_half_m) - team.ball_radius_m
        places = [(team.half_length_m, y) for y in np.linspace(-width_m, width_m, settings.places).tolist()]
        opens = {place: self._open_rad(ball, place, others) for place in places}
        best = max(places, key=opens.__getitem__)
        if self._is_keeper:
            free = [place for place in places if opens[place] > settings.min_aim_rad]
            best = min(free or [best], key=lambda p: abs(wrap_angle(direction_rad(ball, p) - pose.theta_rad)))
        if opens[best] <= 0.0:
            return (team.half_length_m, 0.0), 0.0
        return best, opens[best]

    def _open_rad(self, ball: Point, place: Point, others: list[Point]) -> float:
        """Return the greatest error of a shot at a place, to either side, that no post or running robot stops."""
        team, way_rad, open_rad = self._team, direction_rad(ball, place), self._settings.max_aim_rad
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
            run_s = 0.0 if self._is_keeper else along_m / self._kick_speed_mps - self._settings.reaction_s
            reach_m = team.reach_m + dash_m(run_s, self._limits)
            open_rad = min(open_rad, math.atan2(aside_m - reach_m, along_m))
        return open_rad

    def _follow(self, now: Situation, ball: Point, shot: ShotPlan) -> Plan | None:
        """Kick, turn or approach as in the shot plan; None if its probability is small."""
        if shot.chance < self._settings.min_chance or now.held_s > self._settings.max_held_s:
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
        team, settings = self._team, self._settings
        is_small_turn = abs(wrap_angle(wanted_rad - pose.theta_rad)) <= settings.turn_rad
        if is_small_turn or team.room_ahead_m(pose) >= settings.turn_room_reaches * team.reach_m:
            return Plan("dribble", team.inside(target), wanted_rad, dribble=True, holding=True, why=why)
        back = pose.compose(Pose2(-settings.draw_back_m, 0.0, 0.0))
        place = team.inside((back.x_m, back.y_m))
        return Plan("draw back", place, pose.theta_rad, dribble=True, close=True, holding=True, why=why)


def dash_m(time_s: float, limits: RobotLimits) -> float:
    """Return the distance that a robot covers from rest in a time."""
    speed, acceleration = limits.speed_mps, limits.acceleration_mps2
    faster_s = min(max(time_s, 0.0), speed / acceleration)
    return acceleration * faster_s**2 / 2 + speed * max(time_s - faster_s, 0.0)
