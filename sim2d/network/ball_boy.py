"""Who puts the ball where a person would, as a game controller's packets ask: it moves nothing itself."""

from __future__ import annotations

import math

from field_models import Field
from robocup_vision.ssl.values.referee import Referee, RefereeCommand
from sim2d.match.pitch_rules import penalty_mark
from sim2d.network.packets import COMMANDS
from sim2d.robot_link import Point

C = RefereeCommand
KICK_OFFS, PENALTIES = COMMANDS["prepare_kick_off"], COMMANDS["prepare_penalty"]
# a ball lies where it shall that is so near and so slow
_THERE_M, _STILL_MPS = 0.05, 0.1
# teams that can place the ball have begun to after so long a stop
_BY_HAND_S = 8.0


class BallBoy:
    """Tells where the ball has to be put by hand.

    Kick-offs and penalties begin with the ball on its mark. In a stop the ball is put where the game controller wants
    it if no team has begun to place it for a while.
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
        if packet.command == C.STOP:
            # a team that can place the ball has begun to
            if packet.next_command is None or t_s - self._since_s < _BY_HAND_S:
                return None
        elif packet.command not in (*KICK_OFFS, *PENALTIES):
            return None
        where = kick_place(packet, self._field, -1 if packet.blue_on_positive_half is False else 1)
        if where is None:
            return None
        return where if math.dist(where, ball) > _THERE_M or speed_mps > _STILL_MPS else None


def kick_place(packet: Referee, field: Field, yellow_side: int) -> Point | None:
    """Return where the ball lies before a kick or after a stop; None where that is not known.

    Yellow is on side +1, which attacks the goal at +x, or -1.
    """
    place = packet.designated_position
    where = None if place is None else (place.x_m, place.y_m)
    if packet.command in KICK_OFFS:
        where = (0.0, 0.0)
    elif packet.command in PENALTIES and where is None:
        where = penalty_mark(field, yellow_side if packet.command == C.PREPARE_PENALTY_YELLOW else -yellow_side)
    return where if where is not None and all(map(math.isfinite, where)) else None
