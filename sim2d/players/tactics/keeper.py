"""Decisions of a keeper: its place, the balls it fetches, and blocking of a shot."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robocup_vision.planning.shots.shot_planner import cover_goal
from sim2d.players.ball import BallMemorySettings
from sim2d.players.plan import Plan, Situation
from sim2d.players.tactics.field_player import Fetch
from sim2d.players.tactics.team_field import TeamField, direction_rad
from sim2d.robot_link import Point, Reason


@dataclass(frozen=True, slots=True)
class KeeperSettings:
    """Values of `Keeper`."""

    #: Distance from its goal's line in robot radii, clear of the posts but near enough to cover the mouth.
    line_radii: float = 1.3
    #: It fetches balls within these robot radii of its goal's middle to either side, and of the end line.
    area_radii: float = 7.0
    area_depth_radii: float = 6.0
    #: Greatest speed of a ball that it fetches; faster ones are met on the line.
    slow_ball_mps: float = 0.6
    #: Least speed of a ball that is met where it will cross the line; the direction of a slower one is uncertain.
    rolling_mps: float = 0.2
    #: Distance, in goal widths, within which it blocks a ball that another robot has.
    block_widths: float = 4 / 3
    #: Distance from the ball when it blocks, to avoid a foul.
    block_room_m: float = 0.03
    #: It stands on the line from the ball to a place this far behind the goal's middle.
    aim_depth_m: float = 0.3
    #: Part of the mouth over which it sways without a ball, so that nothing hides the ball for long.
    sway: float = 0.3


class Keeper:
    """Decides for the keeper while it does not hold the ball."""

    def __init__(self, team: TeamField, fetch: Fetch, settings: KeeperSettings, ball: BallMemorySettings) -> None:
        self._team, self._fetch, self._settings, self._ball_settings = team, fetch, settings, ball
        # distance back from the field's centre, and greatest distance to either side
        self._line_m = -team.half_length_m + settings.line_radii * team.robot_radius_m
        self._side_m = team.goal_half_m - 0.5 * team.robot_radius_m

    def owns(self, ball: Point) -> bool:
        """Whether the ball lies in the keeper's area."""
        radius, settings = self._team.robot_radius_m, self._settings
        is_deep = ball[0] < -self._team.half_length_m + settings.area_depth_radii * radius
        return is_deep and abs(ball[1]) < settings.area_radii * radius

    def decide(self, now: Situation) -> Plan:
        """Stand between ball and goal; fetch a ball in front of it; block one that another robot has."""
        settings = self._settings
        if now.ball is None:
            return Plan("keep", (self._line_m, settings.sway * self._side_m * math.sin(now.t_s)), 0.0)
        ball = self._fetch.meeting_place(now, now.ball)
        near_m = settings.block_widths * 2 * self._team.goal_half_m
        if self._is_anothers(now, now.ball) and math.dist(ball, (-self._team.half_length_m, 0.0)) < near_m:
            return self._block(now, ball)
        if self.owns(now.ball) and math.hypot(*now.ball_velocity_mps) < settings.slow_ball_mps:
            return self._fetch.decide(now, now.ball)
        return self.guard(now, now.ball)

    def guard(self, now: Situation, ball: Point) -> Plan:
        """Stand on the line before the goal, between the ball and the goal."""
        y = self._crossing_y(ball, now.ball_velocity_mps)
        target = (self._line_m, max(-self._side_m, min(self._side_m, y)))
        return Plan("keep", target, direction_rad(now.place, ball), dribble=True)

    def _crossing_y(self, ball: Point, velocity_mps: Point) -> float:
        """Return the position on the line: where a rolling ball will cross it, or between ball and goal."""
        (x, y), (v_x, v_y) = ball, velocity_mps
        if v_x < -self._settings.rolling_mps and x > self._line_m:
            return y + v_y / -v_x * (x - self._line_m)
        back, aim_m = self._team.half_length_m, self._settings.aim_depth_m
        return y * ((self._line_m + back + aim_m) / max(x + back + aim_m, aim_m))

    def _is_anothers(self, now: Situation, ball: Point) -> bool:
        """Whether another robot has the ball: it is close to it, and closer than this one."""
        away = math.dist(now.place, ball)
        near = min(away, self._ball_settings.taken_reaches * self._team.reach_m)
        return any(math.dist(other, ball) < near for other in now.others)

    def _block(self, now: Situation, ball: Point) -> Plan:
        """Stand between goal and a ball that another robot has, so close to it that the goal is covered."""
        end, half = -self._team.half_length_m, self._team.goal_half_m
        cover = cover_goal(ball, ((end, half), (end, -half)), self._team.reach_m, self._settings.block_room_m)
        x, y = cover.place_m
        if x < self._line_m:
            # not behind its line: on the crossing with the way there, or beside a ball that is behind
            y += min((self._line_m - x) / max(ball[0] - x, 1e-6), 1.0) * (ball[1] - y)
            x = self._line_m
        open_deg = math.degrees(cover.open_rad)
        why = Reason("shot", "block", f"another robot has the ball, {open_deg:.0f} deg of the goal open to it")
        target = self._team.inside((x, max(-self._side_m, min(self._side_m, y))))
        return Plan("block", target, direction_rad(now.place, ball), dribble=True, why=why)
