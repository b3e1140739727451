"""Decisions of a player without the ball: fetch a free one, support, leave it to the keeper, search."""

from __future__ import annotations

import math

from robocup_vision.geometry import wrap_angle
from sim2d.kick_off import kick_off_row
from sim2d.players.plan import Plan, Situation
from sim2d.players.tactics.team_field import TacticsSettings, TeamField, direction_rad, offset
from sim2d.robot_link import Point

# The ball is met where it will be after this time, about that of the last piece of the way.
_LEAD_S = 0.15
# Distance of a ball from a wall that leaves no room to go round it.
_WALL_REACHES = 2.2
# Distance of the target before the ball's middle, so that the robot arrives with speed.
_THROUGH_REACHES = 0.75
# Distance from which other robots may be touched.
_CLOSE_REACHES = 3.0
# Angle of the way round the ball to drive towards at a time.
_STEP_RAD = 1.2
# Distance of a supporter behind the ball, in reaches: a lost ball is still in front of it, and robots that fight
# for the ball have room.
_BEHIND_BALL_REACHES = 4.0
# A single supporter stays on the side without the ball, by this fraction of the ball's distance from the middle.
_OTHER_SIDE_PART = 0.5
# While the keeper fetches the ball a field player waits at this fraction of the own half's length, and moves to
# either side by this fraction of half the width.
_WAIT_PART = 0.3
# Size of the rectangle around whose corners a search leads, relative to the field.
_SEARCH_PART = 0.4
# Time for each corner.
_SEARCH_CORNER_S = 3.0
# Rotation during a search, for a camera with a narrow view: about 1 rad/s (this angle within
# the turn time of `Motion`), because faster turns blur the picture and slip.
_SEARCH_TURN_RAD = 0.2


class Fetch:
    """Drives one player to the ball."""

    def __init__(self, team: TeamField, settings: TacticsSettings) -> None:
        self._team, self._settings = team, settings

    def decide(self, now: Situation, ball: Point, towards: Point | None = None) -> Plan:
        """Go behind the ball relative to its target if that is near; else straight to it.

        Parameters
        ----------
        towards : (float, float), optional
            Target of the ball; by default the opponent's goal.
        """
        team, settings, reach = self._team, self._settings, self._team.reach_m
        ball = self.meeting_place(now, ball)
        to_ball = direction_rad(now.place, ball)
        to_goal = direction_rad(ball, (team.half_length_m, 0.0) if towards is None else towards)
        away = math.dist(now.place, ball)
        off = wrap_angle(to_ball - to_goal)
        is_straight = abs(off) < settings.straight_rad or away > settings.straight_reaches * reach
        is_close = away < _CLOSE_REACHES * reach
        if is_straight or team.is_near_wall(ball, _WALL_REACHES * reach):
            place = team.inside(offset(ball, to_ball, -_THROUGH_REACHES * reach))
            return Plan("fetch", place, to_ball, dribble=True, close=is_close, races=True)
        # around it on the nearer side
        side = 1.0 if off > 0 else -1.0
        approach_rad = to_goal + math.pi + side * max(abs(off) - _STEP_RAD, 0.0)
        place = team.inside(offset(ball, approach_rad, settings.round_reaches * reach))
        return Plan("get behind", place, to_ball, avoid_ball=True, close=is_close, races=True)

    def meeting_place(self, now: Situation, ball: Point) -> Point:
        """Return where a rolling ball will be when the robot meets it."""
        v_x, v_y = now.ball_velocity_mps
        return self._team.nearest_ball_place((ball[0] + _LEAD_S * v_x, ball[1] + _LEAD_S * v_y))


class FieldPlayer:
    """Decides for one player without the ball.

    Field players divide the field into strips along its length, so that two of a team do not go for the same ball, in
    their order at a kick-off, so that none has to cross another's. With messages, the present supporters divide it.
    """

    def __init__(self, team: TeamField, number: int, players: int, settings: TacticsSettings) -> None:
        self._team, self._number, self._players, self._settings = team, number, players, settings
        self._strip = kick_off_row(number, players)

    def is_in_own_strip(self, ball: Point) -> bool:
        """Whether the ball is in this player's strip."""
        strips = max(self._players - 1, 1)
        strip = min(int((ball[1] / self._team.half_width_m + 1) / 2 * strips), strips - 1)
        return strip == self._strip

    def support(self, now: Situation, ball: Point) -> Plan:
        """Follow the ball in the own strip."""
        low, high_m = self._settings.support_limits
        behind_m = _BEHIND_BALL_REACHES * self._team.reach_m
        x = min(max(ball[0] - behind_m, low * self._team.half_length_m), high_m)
        y, places = self._own_strip(now)
        if places == 1 and now.role is not None and now.role.is_agreed:
            y = -_OTHER_SIDE_PART * ball[1]
        return self._face(now, "support", (x, y), ball)

    def leave_to_keeper(self, now: Situation, ball: Point) -> Plan:
        """Wait in front of the own goal, moving to and fro so that a kick's way is not blocked for long."""
        team, part = self._team, _WAIT_PART
        y, places = self._own_strip(now)
        # so that several stay beside each other
        way_m = min(part * team.half_width_m, max(team.half_width_m / places - team.robot_radius_m, 0.0))
        target = (-part * team.half_length_m, y + way_m * math.sin(0.5 * now.t_s))
        return self._face(now, "leave it to the keeper", target, ball)

    def _own_strip(self, now: Situation) -> tuple[float, int]:
        """Return the middle of the player's own strip, and the number of strips."""
        place, places = self._strip, max(self._players - 1, 1)
        if now.role is not None and now.role.is_agreed:
            place, places = now.role.place, now.role.places
        return self._team.half_width_m * ((2 * place + 1) / places - 1), places

    def search(self, now: Situation) -> Plan:
        """Go around the field's middle, to look behind what may hide the ball."""
        # several searchers start at different corners
        first = max(self._number - 1, 0) if now.role is None else now.role.place
        corner = (int(now.t_s / _SEARCH_CORNER_S) + first) % 4
        x = (1, -1, -1, 1)[corner] * _SEARCH_PART * self._team.half_length_m
        y = (1, 1, -1, -1)[corner] * _SEARCH_PART * self._team.half_width_m
        return Plan("search", (x, y), now.pose.theta_rad + _SEARCH_TURN_RAD)

    def _face(self, now: Situation, intent: str, target: Point, ball: Point) -> Plan:
        return Plan(intent, self._team.inside(target), direction_rad(now.place, ball))
