"""Decides where a person would have to put the ball, by the game controller's packets; it does not move it itself."""

from __future__ import annotations

import math

from field_models import Field
from robocup_vision.ssl.values.referee import Referee, RefereeCommand
from sim2d.match.pitch_rules import penalty_mark
from sim2d.network.packets import COMMANDS
from sim2d.robot_link import Point

C = RefereeCommand
KICK_OFFS, PENALTIES = COMMANDS["prepare_kick_off"], COMMANDS["prepare_penalty"]
# distance and speed within which the ball counts as placed
_PLACED_M, _STILL_MPS = 0.05, 0.1
# time in a stop by which a team that can place the ball has begun to
_BY_HAND_S = 8.0


class BallBoy:
    """Decides where the ball has to be put by hand.

    Kick-offs and penalties begin with the ball on its mark. In a stop the ball is put where the game controller wants
    it, if no team has begun to place it for a while.
    """

    def __init__(self, field: Field) -> None:
        self._field = field
        self._packet: Referee | None = None
        self._since_s = 0.0

    def hear(self, packet: Referee, t_s: float) -> None:
        """Process a packet received at a time."""
        before, self._packet = self._packet, packet
        if before is None or before.command_counter != packet.command_counter or t_s < self._since_s:
            self._since_s = t_s

    def wants(self, t_s: float, ball: Point, speed_mps: float) -> Point | None:
        """Return where the ball has to be put now, field frame; None if it may stay."""
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
        return where if math.dist(where, ball) > _PLACED_M or speed_mps > _STILL_MPS else None


def kick_place(packet: Referee, field: Field, yellow_side: int) -> Point | None:
    """Return where the ball must lie before a kick or after a stop, field frame; None if that is not known.

    `yellow_side` is +1 if yellow attacks the goal at +x, else -1.
    """
    place = packet.designated_position
    where = None if place is None else (place.x_m, place.y_m)
    if packet.command in KICK_OFFS:
        where = (0.0, 0.0)
    elif packet.command in PENALTIES and where is None:
        where = penalty_mark(field, yellow_side if packet.command == C.PREPARE_PENALTY_YELLOW else -yellow_side)
    return where if where is not None and all(map(math.isfinite, where)) else None
