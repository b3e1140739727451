"""How a player gets at a free ball: straight to it, or round it where it would play it to its own goal."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robocup_vision.geometry import wrap_angle
from sim2d.players.plan import Plan, Situation
from sim2d.players.tactics.team_field import TeamField, direction_rad, offset
from sim2d.robot_link import Point


@dataclass(frozen=True, slots=True)
class FetchSettings:
    """Values of `Fetch`; lengths in reaches (robot radius plus ball radius) unless the name has a unit."""

    #: The ball is met where it rolls to in this time: about the way's length for the last piece.
    lead_s: float = 0.15
    #: Within this angle of the line from ball to opponent's goal the robot takes the ball from where it is.
    straight_rad: float = 0.9
    #: Farther away than this it drives straight too: the ball moves on before it arrives.
    straight_reaches: float = 6.0
    #: A ball so near to a wall leaves no room to go round it.
    wall_reaches: float = 2.2
    #: The target lies so far before the ball's middle, so that the robot arrives with speed enough to take the ball.
    through_reaches: float = 0.75
    #: From here on other robots may be touched.
    close_reaches: float = 3.0
    #: Radius of the way round the ball.
    round_reaches: float = 1.5
    #: Part of that way driven towards at a time.
    step_rad: float = 1.2


class Fetch:
    """Takes one player to the ball."""

    def __init__(self, team: TeamField, settings: FetchSettings) -> None:
        self._team, self._settings = team, settings

    def decide(self, now: Situation, ball: Point, towards: Point | None = None) -> Plan:
        """Go behind the ball as seen from where it shall go, where that is near; else straight to it.

        Parameters
        ----------
        towards : (float, float), optional
            Where it shall go; default: into the opponent's goal.
        """
        team, settings, reach = self._team, self._settings, self._team.reach_m
        ball = self.meeting_place(now, ball)
        to_ball = direction_rad(now.place, ball)
        to_goal = direction_rad(ball, (team.half_length_m, 0.0) if towards is None else towards)
        away = math.dist(now.place, ball)
        off = wrap_angle(to_ball - to_goal)
        is_straight = abs(off) < settings.straight_rad or away > settings.straight_reaches * reach
        is_close = away < settings.close_reaches * reach
        if is_straight or team.is_near_wall(ball, settings.wall_reaches * reach):
            place = team.inside(offset(ball, to_ball, -settings.through_reaches * reach))
            return Plan("fetch", place, to_ball, dribble=True, close=is_close, races=True)
        # on the near side round it
        side = 1.0 if off > 0 else -1.0
        approach_rad = to_goal + math.pi + side * max(abs(off) - settings.step_rad, 0.0)
        place = team.inside(offset(ball, approach_rad, settings.round_reaches * reach))
        return Plan("get behind", place, to_ball, avoid_ball=True, close=is_close, races=True)

    def meeting_place(self, now: Situation, ball: Point) -> Point:
        """Return where a rolling ball will be after `lead_s`."""
        lead_s, (v_x, v_y) = self._settings.lead_s, now.ball_velocity_mps
        return self._team.nearest_ball_place((ball[0] + lead_s * v_x, ball[1] + lead_s * v_y))
