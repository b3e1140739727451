"""Lets the league's game controller referee sim2d's own matches; it is either listened to or driven.

Its commands determine the phase for the players. Before a kick the ball is put in place as by a person.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence

from field_models import Field
from field_models.errors import ArgumentError
from robocup_vision.ssl.controller_clients import CiClient
from robocup_vision.ssl.field import geometry_from_field
from robocup_vision.ssl.game import Game
from robocup_vision.ssl.log import NS_PER_S
from robocup_vision.ssl.values.referee import CiInput, Referee, RefereeCommand
from robocup_vision.ssl.values.simulation import Team
from robocup_vision.ssl.values.tracked import TrackerPacket
from sim2d.match.pitch_rules import kick_time_s
from sim2d.network.ball_boy import KICK_OFFS, PENALTIES, kick_place
from sim2d.network.packets import COMMANDS, TRUTH_SOURCE, TRUTH_UUID, tracked_frame
from sim2d.robot_link import Phase
from sim2d.world.referee import Ruling
from sim2d.world.state import BallState, Event, RobotState

# distance within which the game controller accepts a ball as placed
_PLACED_M = 0.15
_KICKS = (*KICK_OFFS, *PENALTIES, *COMMANDS["direct_free"])
# time without an answer after which a game controller counts as failed
_MAX_SILENCE_S = 10.0


#: Returns the game controller's packets since the last call. Arguments: time of the match, true robots and ball at that
#: time, and whether blue is on the positive half.
RefereeSource = Callable[[float, Sequence[RobotState], BallState, bool], list[Referee]]


class DrivenReferee:
    """A `RefereeSource`: a game controller that runs on the match's time, and sees it through tracker packets.

    Parameters
    ----------
    field : Field
        The field, whose geometry is sent in the first exchange.
    """

    def __init__(self, client: CiClient, field: Field) -> None:
        self._client, self._field = client, field
        self._frames = 0
        self._answered_s = time.monotonic()
        self._begin_ns = time.time_ns()

    def __call__(self, t_s: float, robots: Sequence[RobotState], ball: BallState, blue_positive: bool) -> list[Referee]:
        """Send a moment of the match; return the answers. Raises `ArgumentError` if there are none for too long."""
        geometry = geometry_from_field(self._field) if self._frames == 0 else None
        self._frames += 1
        frame = tracked_frame(self._frames, self._begin_ns / NS_PER_S + t_s, robots, ball, 1 if blue_positive else -1)
        now_ns = self._begin_ns + round(NS_PER_S * t_s)
        moment = CiInput(now_ns, TrackerPacket(TRUTH_UUID, TRUTH_SOURCE, frame), geometry=geometry)
        packets = self._client.exchange(moment)
        if packets:
            self._answered_s = time.monotonic()
        elif time.monotonic() - self._answered_s > _MAX_SILENCE_S:
            raise ArgumentError(f"the game controller has not answered for {_MAX_SILENCE_S:g} s")
        return packets


class ForeignReferee:
    """Implements `sim2d.world.referee.MatchReferee` with a game controller."""

    def __init__(self, source: RefereeSource, field: Field) -> None:
        self._source, self._field = source, field
        self._game = Game(Team.YELLOW, kick_time_s(field))
        self._packet: Referee | None = None
        self._blue_positive = True
        self.phase: Phase = "halt"
        self.kick_off_side = 1
        self.score = {1: 0, -1: 0}
        self.placement_m: tuple[float, float] | None = None

    def judge(self, t_s: float, robots: Sequence[RobotState], ball: BallState) -> list[Ruling]:
        """Process the game controller's packets; return the rulings that follow from them."""
        rulings: list[Ruling] = []
        for packet in self._source(t_s, robots, ball, self._blue_positive):
            before, self._packet = self._packet, packet
            self._game.update(packet, received_s=t_s)
            if packet.blue_on_positive_half is not None:
                self._blue_positive = packet.blue_on_positive_half
            if before is None or before.command_counter != packet.command_counter:
                rulings += self._put_ball(t_s, packet, ball)
        if self._packet is not None:
            yellow = self._yellow_side
            goals = {yellow: self._packet.yellow.score, -yellow: self._packet.blue.score}
            scorers = [side for side in (1, -1) if goals[side] > self.score[side]]
            rulings += [Ruling(Event(t_s, "goal", side=side)) for side in scorers]
            self.score = goals
            state = self._game.state(t_s, (ball.x_m, ball.y_m))
            self.phase = state.phase
            self.kick_off_side = yellow if state.own_turn else -yellow
            self.placement_m = state.placement_m if state.phase == "ball_placement" else None
        return rulings

    @property
    def _yellow_side(self) -> int:
        return 1 if self._blue_positive else -1

    def _put_ball(self, t_s: float, packet: Referee, ball: BallState) -> list[Ruling]:
        """Return a ruling that places the ball for a kick, if it lies elsewhere, or one that whistles for a start."""
        if packet.command in (RefereeCommand.NORMAL_START, RefereeCommand.FORCE_START):
            return [Ruling(Event(t_s, "whistle"))]
        if packet.command not in _KICKS:
            return []
        where = kick_place(packet, self._field, self._yellow_side)
        if where is None or math.dist(where, (ball.x_m, ball.y_m)) <= _PLACED_M:
            return []
        return [Ruling(None, where)]
