"""Choice of the deciding role: kick-off, ball holder, keeper or field player."""

from __future__ import annotations

import math
from dataclasses import dataclass

from field_models.field import Field
from sim2d.players.ball import BallMemorySettings
from sim2d.players.plan import Plan, Situation
from sim2d.players.tactics.ball_holder import BallHolder, BallHolderSettings
from sim2d.players.tactics.field_player import Fetch, FetchSettings, FieldPlayer, FieldPlayerSettings
from sim2d.players.tactics.keeper import Keeper, KeeperSettings
from sim2d.players.tactics.set_pieces import KickOff, Restart, RestartSettings
from sim2d.players.tactics.team_field import TeamField
from sim2d.robot_link import Point, RobotLimits


@dataclass(frozen=True, slots=True)
class TacticsSettings:
    """Values of `Tactics`."""

    keeper: KeeperSettings = KeeperSettings()
    ball_holder: BallHolderSettings = BallHolderSettings()
    fetch: FetchSettings = FetchSettings()
    field_player: FieldPlayerSettings = FieldPlayerSettings()
    restart: RestartSettings = RestartSettings()
    #: Least distance between robot and wall at a target; steering would stop the robot before a closer one.
    wall_clearance_m: float = 0.015
    #: Whether players from number 2 on fetch a ball in their own strip, without agreement; else only number 1 fetches.
    fetches_in_strip: bool = True
    #: Without agreement, number 1 leaves a ball in another's strip for this time after it saw a robot closer to it,
    #: within this number of reaches: that is its mate, or an opponent whom its mate meets. A head looks at the ball
    #: again within that time.
    give_way_reaches: float = 3.0
    give_way_s: float = 1.5


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
        ball: BallMemorySettings = BallMemorySettings(),
    ) -> None:
        self.is_keeper = number == 0 and players > 1
        self._number, self._players = number, players
        team = TeamField(field, limits, settings.wall_clearance_m)
        self._kick_off = KickOff(field, team, number, players, settings.restart.behind_reaches)
        self._ball_holder = BallHolder(team, limits, self.is_keeper, settings.ball_holder, settings.keeper)
        self._fetch = Fetch(team, settings.fetch)
        self._keeper = Keeper(team, self._fetch, settings.keeper, ball)
        self._field_player = FieldPlayer(team, number, players, settings.field_player)
        self._settings, self._reach_m = settings, team.reach_m
        # when number 1 last saw a robot closer to a ball in another's strip
        self._nearer_s = -math.inf
        self._restart = Restart(
            team,
            self._fetch,
            self._keeper,
            self._field_player,
            number,
            players,
            limits.kick_speed_mps,
            settings.restart,
        )

    def decide(self, now: Situation) -> Plan:
        """Choose the next plan."""
        if now.phase == "kick_off":
            return self._kick_off.decide(now)
        bound = None if now.phase == "play" else self._restart.decide(now)
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
        if now.role is not None and now.role.is_agreed:
            if now.role.role == "fetch":
                return self._fetch.decide(now, now.ball)
            return self._field_player.support(now, now.ball)
        if self._takes(now, now.ball):
            return self._fetch.decide(now, now.ball)
        return self._field_player.support(now, now.ball)

    def _takes(self, now: Situation, ball: Point) -> bool:
        """Whether a player without agreement fetches the ball."""
        settings = self._settings
        if not settings.fetches_in_strip:
            return self._number < 2
        if self._field_player.is_in_own_strip(ball):
            return True
        if self._number >= 2:
            return False
        near_m = min(math.dist(now.place, ball), settings.give_way_reaches * self._reach_m)
        if any(math.dist(other, ball) < near_m for other in (*now.obstacles, *now.others)):
            self._nearer_s = now.t_s
        return now.t_s - self._nearer_s > settings.give_way_s
