"""Interprets the game controller's packets for one team: the phase of play, whose turn it is, and the limits.

A command alone does not determine the phase. `NORMAL_START` has different meanings after a prepared kick-off and after
a prepared penalty, and a free kick ends when the ball has moved. Packets are repeated, and any of them may be lost. In
doubt the game counts as halted: after an unknown command, or before it is clear which sender is the referee.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Literal

from field_models.errors import ArgumentError
from robocup_vision.ssl.source_choice import SourceChoice
from robocup_vision.ssl.values.referee import Referee, RefereeCommand
from robocup_vision.ssl.values.simulation import Team

Phase = Literal[
    "kick_off",
    "play",
    "halt",
    "stop",
    "time_out",
    "free_kick",
    "prepare_penalty",
    "penalty",
    "ball_placement",
]

C = RefereeCommand
# phase of each command, and the team whose turn it is
_COMMANDS: dict[RefereeCommand, tuple[Phase, Team]] = {
    C.HALT: ("halt", Team.UNKNOWN),
    C.STOP: ("stop", Team.UNKNOWN),
    C.NORMAL_START: ("play", Team.UNKNOWN),
    C.FORCE_START: ("play", Team.UNKNOWN),
    C.PREPARE_KICKOFF_YELLOW: ("kick_off", Team.YELLOW),
    C.PREPARE_KICKOFF_BLUE: ("kick_off", Team.BLUE),
    C.PREPARE_PENALTY_YELLOW: ("prepare_penalty", Team.YELLOW),
    C.PREPARE_PENALTY_BLUE: ("prepare_penalty", Team.BLUE),
    C.DIRECT_FREE_YELLOW: ("free_kick", Team.YELLOW),
    C.DIRECT_FREE_BLUE: ("free_kick", Team.BLUE),
    C.INDIRECT_FREE_YELLOW: ("free_kick", Team.YELLOW),
    C.INDIRECT_FREE_BLUE: ("free_kick", Team.BLUE),
    C.TIMEOUT_YELLOW: ("time_out", Team.YELLOW),
    C.TIMEOUT_BLUE: ("time_out", Team.BLUE),
    # sent only for a moment while the game is stopped
    C.GOAL_YELLOW: ("stop", Team.UNKNOWN),
    C.GOAL_BLUE: ("stop", Team.UNKNOWN),
    C.BALL_PLACEMENT_YELLOW: ("ball_placement", Team.YELLOW),
    C.BALL_PLACEMENT_BLUE: ("ball_placement", Team.BLUE),
}


# distance from the place of a kick at which the ball is in play, by the rules
_IN_PLAY_M = 0.05


@dataclass(frozen=True, slots=True)
class GameState:
    """The state of the game for one team."""

    phase: Phase  #: a kick-off that has been started is a free kick until the ball has moved
    #: whether this team has the kick-off, free kick, penalty, ball placement or time-out
    own_turn: bool
    attacks: int | None  #: +1: this team plays towards +x; -1: towards -x; None: unknown
    #: numbers of the robots that keep the goals
    goalkeeper: int
    opponent_goalkeeper: int
    #: number of robots of this team that may be on the field, with regard to yellow cards; None: unknown
    max_robots: int | None
    placement_m: tuple[float, float] | None  #: where the ball is to be placed, field frame
    next_phase: Phase | None = None  #: the phase after this stop or placement; None: unknown
    next_own_turn: bool = False  #: whether it will be this team's turn then
    #: time left for the kick, placement or preparation; None: unknown
    action_left_s: float | None = None
    can_place_ball: bool = True  #: whether the game controller lets this team place the ball
    doubt: str = ""  #: why the game counts as halted without the command HALT; empty if it does not


# before the first packet no robot may move
_SILENT = GameState("halt", False, None, 0, 0, None, None, doubt="no referee")


class Game:
    """Follows the referee for one team.

    Parameters
    ----------
    kick_s : float
        Time after which both teams may play a ball that has not been kicked: ten seconds in division B, five in
        division A. If the game controller sends the time left, that is used instead.

    Raises
    ------
    ArgumentError
        If the team is neither yellow nor blue.
    """

    def __init__(self, team: Team, kick_s: float = 10.0) -> None:
        if team not in (Team.YELLOW, Team.BLUE):
            raise ArgumentError(f"team must be yellow or blue, got {team!r}")
        self._team, self._kick_s = team, kick_s
        self._referees = SourceChoice("referee packets")
        self._packet: Referee | None = None
        self._is_lost = False
        self._phase: Phase = "halt"
        self._turn = Team.UNKNOWN
        self._since_s: float | None = None
        self._kick_from: tuple[float, float] | None = None

    def update(self, packet: Referee, address: tuple[str, int] | None = None, received_s: float | None = None) -> None:
        """Take in a packet. A repeated command does not change the phase; packets of another referee are ignored.

        Parameters
        ----------
        received_s : float, optional
            Time of reception, by any monotonic clock; default: now.
        """
        source = packet.source_identifier, address
        if not self._referees.hear(source, time.monotonic() if received_s is None else received_s):
            return
        self._is_lost = False
        before, self._packet = self._packet, packet
        is_same = before is not None and (before.command_counter, before.command, before.source_identifier) == (
            packet.command_counter,
            packet.command,
            packet.source_identifier,
        )
        if is_same:
            return
        phase, turn = _COMMANDS.get(packet.command, ("halt", Team.UNKNOWN))
        if packet.command == C.NORMAL_START and self._phase in ("kick_off", "prepare_penalty"):
            phase, turn = ("free_kick" if self._phase == "kick_off" else "penalty"), self._turn
        self._phase, self._turn = phase, turn
        self._since_s = self._kick_from = None

    def lose_referee(self) -> None:
        """Count as halted until the next packet of the referee; the phase is remembered until then."""
        self._is_lost = True

    @property
    def problem(self) -> str:
        """The problem with the sender of the packets, in words; empty if there is none."""
        return self._referees.problem

    def state(self, t_s: float, ball_m: tuple[float, float] | None) -> GameState:
        """Return the state at a time.

        Parameters
        ----------
        t_s : float
            The present time, by any monotonic clock.
        ball_m : (float, float) or None
            Position of the ball, field frame; None while it is not known.
        """
        packet = self._packet
        if packet is None or self._is_lost:
            return _SILENT
        if self._phase == "free_kick":
            self._watch_kick(t_s, ball_m)
        own, other = (packet.yellow, packet.blue) if self._team == Team.YELLOW else (packet.blue, packet.yellow)
        attacks = None
        if packet.blue_on_positive_half is not None:
            attacks = 1 if packet.blue_on_positive_half == (self._team == Team.YELLOW) else -1
        place = packet.designated_position
        next_phase, next_turn = (None, Team.UNKNOWN)
        if packet.next_command is not None:
            next_phase, next_turn = _COMMANDS.get(packet.next_command, (None, Team.UNKNOWN))
        left_us = packet.action_time_left_us
        return GameState(
            self._phase,
            self._turn == self._team,
            attacks,
            own.goalkeeper,
            other.goalkeeper,
            own.max_allowed_robots,
            None if place is None or not _is_finite(place.x_m, place.y_m) else (place.x_m, place.y_m),
            next_phase,
            next_turn == self._team,
            None if left_us is None else left_us / 1e6,
            own.can_place_ball is not False,
            "" if packet.command.is_known else str(packet.command),
        )

    def _watch_kick(self, t_s: float, ball_m: tuple[float, float] | None) -> None:
        """Let play go on once the ball has moved, or the time for the kick is over."""
        if self._since_s is None or t_s < self._since_s:
            # the kick begins, or the clock was set back
            self._since_s = t_s
        if self._kick_from is None:
            self._kick_from = ball_m
        moved = ball_m is not None and self._kick_from is not None and math.dist(ball_m, self._kick_from) > _IN_PLAY_M
        left_us = None if self._packet is None else self._packet.action_time_left_us
        is_late = t_s - self._since_s > self._kick_s if left_us is None else left_us < 0
        if moved or is_late:
            self._phase, self._turn = "play", Team.UNKNOWN


def _is_finite(*values: float) -> bool:
    return all(map(math.isfinite, values))
