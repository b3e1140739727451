"""Choice of the deciding role: kick-off, ball holder, keeper or field player."""

from __future__ import annotations

import math

from field_models.field import Field
from sim2d.kick_off import kick_off_pose
from sim2d.players.plan import Plan, Situation
from sim2d.players.tactics.ball_holder import BallHolder
from sim2d.players.tactics.field_player import Fetch, FieldPlayer
from sim2d.players.tactics.keeper import Keeper
from sim2d.players.tactics.set_pieces import SetPieces
from sim2d.players.tactics.team_field import TacticsSettings, TeamField
from sim2d.robot_link import Point, RobotLimits

# Without agreement, number 1 leaves a ball in another's strip for this time after it saw a robot closer to it, within
# this number of reaches: that is its mate, or an opponent whom its mate meets. A head looks at the ball again within
# that time.
_GIVE_WAY_REACHES = 3.0
_GIVE_WAY_S = 1.5


class Tactics:
    """Decides for one player, by its number and its situation; not called during a halt or time-out.

    Number 0 is the keeper if there are others. Who of the others fetches the ball is agreed by messages. Without
    messages number 1 does, further ones only fetch it in their own strip of the field, and number 1 gives way to a
    robot that is closer to the ball.
    """

    def __init__(
        self,
        field: Field,
        limits: RobotLimits,
        number: int,
        players: int,
        settings: TacticsSettings = TacticsSettings(),
    ) -> None:
        self.is_keeper = number == 0 and players > 1
        self._number, self._players = number, players
        team = TeamField(field, limits)
        self._ball_holder = BallHolder(team, limits, self.is_keeper)
        self._fetch = Fetch(team, settings)
        self._keeper = Keeper(team, self._fetch, settings)
        self._field_player = FieldPlayer(team, number, players, settings)
        self._settings, self._reach_m = settings, team.reach_m
        # when number 1 last saw a robot closer to a ball in another's strip
        self._nearer_s = -math.inf
        home = kick_off_pose(field, 1, number, players, limits.radius_m)
        self._set_pieces = SetPieces(
            team, self._fetch, self._keeper, self._field_player, number, players, limits.kick_speed_mps, home
        )

    def decide(self, now: Situation) -> Plan:
        """Choose the next plan."""
        bound = self._set_pieces.decide(now)
        if bound is not None:
            return bound
        if now.in_mouth:
            return self._ball_holder.decide(now)
        if self.is_keeper:
            return self._keeper.decide(now)
        if now.ball is None:
            return self._field_player.search(now)
        if self._keeper.owns(now.ball) and self._players > 1:
            return self._field_player.leave_to_keeper(now, now.ball)
        if self._takes(now, now.ball):
            return self._fetch.decide(now, now.ball)
        return self._field_player.support(now, now.ball)

    def _takes(self, now: Situation, ball: Point) -> bool:
        """Whether the player fetches the ball: as agreed, or without agreement by its number and what it sees."""
        if now.role is not None and now.role.is_agreed:
            return now.role.role == "fetch"
        if not self._settings.fetches_in_strip:
            return self._number < 2
        if self._field_player.is_in_own_strip(ball):
            return True
        if self._number >= 2:
            return False
        near_m = min(math.dist(now.place, ball), _GIVE_WAY_REACHES * self._reach_m)
        if any(math.dist(other, ball) < near_m for other in (*now.obstacles, *now.others)):
            self._nearer_s = now.t_s
        return now.t_s - self._nearer_s > _GIVE_WAY_S
