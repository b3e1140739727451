"""Who puts the ball where a person would, as a game controller's packets ask: it moves nothing itself."""

from __future__ import annotations

import math

from field_models import Field
from robocup_vision.ssl.values.referee import Referee, RefereeCommand
from sim2d.match.pitch_rules import penalty_mark

Point = tuple[float, float]

C = RefereeCommand
_KICK_OFFS = (C.PREPARE_KICKOFF_YELLOW, C.PREPARE_KICKOFF_BLUE)
_PENALTIES = (C.PREPARE_PENALTY_YELLOW, C.PREPARE_PENALTY_BLUE)
# a ball lies where it shall that is so near and so slow
_THERE_M, _STILL_MPS = 0.05, 0.1
# teams that can place the ball have begun to after so long a stop
_BY_HAND_S = 8.0


class BallBoy:
    """Tells where the ball has to be put by hand.

    Kick-offs and penalties begin with the ball on its mark. In a stop the ball is put where the game controller wants
    it if no team has begun to place it for a while.

    Parameters
    ----------
    field : Field
        The pitch.
    """

    def __init__(self, field: Field) -> None:
        self._field = field
        self._packet: Referee | None = None
        self._since_s = 0.0

    def hear(self, packet: Referee, t_s: float) -> None:
        """Take in a packet at a time."""
        before, self._packet = self._packet, packet
        if before is None or before.command_counter != packet.command_counter or t_s < self._since_s:
            self._since_s = t_s

    def wants(self, t_s: float, ball: Point, speed_mps: float) -> Point | None:
        """Return where the ball has to be put now; None where it may stay."""
        packet = self._packet
        if packet is None:
            return None
        place = None if packet.designated_position is None else packet.designated_position
        where = None if place is None else (place.x_m, place.y_m)
        if packet.command in _KICK_OFFS:
            where = (0.0, 0.0)
        elif packet.command in _PENALTIES:
            yellow = 1 if packet.blue_on_positive_half is not False else -1
            where = where or penalty_mark(self._field, yellow if packet.command == _PENALTIES[0] else -yellow)
        elif packet.command != C.STOP or packet.next_command is None or t_s - self._since_s < _BY_HAND_S:
            return None
        if where is None or not all(map(math.isfinite, where)):
            return None
        return where if math.dist(where, ball) > _THERE_M or speed_mps > _STILL_MPS else None
