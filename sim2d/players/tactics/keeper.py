"""Decisions of a keeper: its place, the balls it fetches, and blocking of a shot."""

from __future__ import annotations

import math

from robocup_vision.planning.shots.shot_planner import cover_goal
from sim2d.players.ball import TAKEN_REACHES
from sim2d.players.plan import Plan, Situation
from sim2d.players.tactics.field_player import Fetch
from sim2d.players.tactics.team_field import KEEPER_LINE_RADII, TacticsSettings, TeamField, direction_rad
from sim2d.robot_link import Point, Reason

# Greatest speed of a ball that a keeper fetches; faster ones are met on the line.
_SLOW_BALL_MPS = 0.6
# Least speed of a ball that is met where it will cross the line; the direction of a slower one is uncertain.
_ROLLING_MPS = 0.2
# Distance from the ball when it blocks, to avoid a foul.
_BLOCK_ROOM_M = 0.03
# A keeper stands on the line from the ball to a place this far behind the goal's middle.
_AIM_DEPTH_M = 0.3
# Fraction of the goal's mouth over which it sways without a ball, so that nothing hides the ball for long.
_SWAY = 0.3


class Keeper:
    """Decides for the keeper while it does not hold the ball."""

    def __init__(self, team: TeamField, fetch: Fetch, settings: TacticsSettings) -> None:
        self._team, self._fetch, self._settings = team, fetch, settings
        # distance back from the field's centre, and greatest distance to either side
        self._line_m = -team.half_length_m + KEEPER_LINE_RADII * team.robot_radius_m
        self._side_m = team.goal_half_m - 0.5 * team.robot_radius_m

    def owns(self, ball: Point) -> bool:
        """Whether the ball lies in the keeper's area."""
        radius, settings = self._team.robot_radius_m, self._settings
        is_deep = ball[0] < -self._team.half_length_m + settings.keeper_depth_radii * radius
        return is_deep and abs(ball[1]) < settings.keeper_area_radii * radius

    def decide(self, now: Situation) -> Plan:
        """Stand between ball and goal; fetch a ball in front of it; block one that another robot has."""
        if now.ball is None:
            return Plan("keep", (self._line_m, _SWAY * self._side_m * math.sin(now.t_s)), 0.0)
        ball = self._fetch.meeting_place(now, now.ball)
        near_m = self._settings.block_widths * 2 * self._team.goal_half_m
        if self._is_anothers(now, now.ball) and math.dist(ball, (-self._team.half_length_m, 0.0)) < near_m:
            return self._block(now, ball)
        if self.owns(now.ball) and math.hypot(*now.ball_velocity_mps) < _SLOW_BALL_MPS:
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
        if v_x < -_ROLLING_MPS and x > self._line_m:
            return y + v_y / -v_x * (x - self._line_m)
        back = self._team.half_length_m
        return y * ((self._line_m + back + _AIM_DEPTH_M) / max(x + back + _AIM_DEPTH_M, _AIM_DEPTH_M))

    def _is_anothers(self, now: Situation, ball: Point) -> bool:
        """Whether another robot has the ball: it is close to it, and closer than this one."""
        away = math.dist(now.place, ball)
        near = min(away, TAKEN_REACHES * self._team.reach_m)
        return any(math.dist(other, ball) < near for other in now.others)

    def _block(self, now: Situation, ball: Point) -> Plan:
        """Stand between goal and a ball that another robot has, so close to it that the goal is covered."""
        end, half = -self._team.half_length_m, self._team.goal_half_m
        cover = cover_goal(ball, ((end, half), (end, -half)), self._team.reach_m, _BLOCK_ROOM_M)
        x, y = cover.place_m
        if x < self._line_m:
            # not behind its line: on the crossing with the way there, or beside a ball that is behind
            y += min((self._line_m - x) / max(ball[0] - x, 1e-6), 1.0) * (ball[1] - y)
            x = self._line_m
        open_deg = math.degrees(cover.open_rad)
        why = Reason("shot", "block", f"another robot has the ball, {open_deg:.0f} deg of the goal open to it")
        target = self._team.inside((x, max(-self._side_m, min(self._side_m, y))))
        return Plan("block", target, direction_rad(now.place, ball), dribble=True, why=why)
