"""Where a player stands at a kick-off."""

from __future__ import annotations

from field_models.field import Field
from sim2d.kick_off import kick_off_pose
from sim2d.players.plan import Plan, Situation
from sim2d.players.tactics.team_field import TeamField, direction_rad


class KickOff:
    """Sends one player to its place.

    Parameters
    ----------
    field : Field
        The pitch.
    team : TeamField
        The same, in the team's frame.
    number, players : int
        As in `PlayerSetup`.
    behind_reaches : float
        The player that kicks off waits so many reaches behind the ball.
    """

    def __init__(self, field: Field, team: TeamField, number: int, players: int, behind_reaches: float) -> None:
        self._team, self._behind_reaches = team, behind_reaches
        self._place = kick_off_pose(field, 1, number, players, team.robot_radius_m)
        self._is_taker = number == min(1, players - 1)

    def decide(self, now: Situation) -> Plan:
        """Go to the kick-off place; who takes the kick waits right behind the ball."""
        x = -self._behind_reaches * self._team.reach_m if now.kick_off and self._is_taker else self._place.x_m
        target = (x, self._place.y_m)
        return Plan("kick-off", target, direction_rad(target, (0.0, 0.0)), avoid_ball=True)
