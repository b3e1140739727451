"""The simulator's connections to a running game controller: an automatic referee, and an operator for its web page.

With these and two teams, a game controller runs a whole match by itself.
"""

from __future__ import annotations

import math
import time
from contextlib import ExitStack

from field_models import Field
from field_models.errors import ArgumentError, PacketError
from robocup_vision.closing import Closing
from robocup_vision.ssl.controller_clients import AutoRefClient, CiClient
from robocup_vision.ssl.field import geometry_from_field
from robocup_vision.ssl.log import NS_PER_S
from robocup_vision.ssl.operator import Operator
from robocup_vision.ssl.problems import Problems
from robocup_vision.ssl.values.referee import CiInput, Referee
from sim2d.match.pitch_rules import is_division_a
from sim2d.network.autoref import Autoref
from sim2d.network.packets import tracker_packet
from sim2d.network.world import STEPS_PER_S, LeagueState

IDENTIFIER = "sim2d"
# period of the operator's actions: a person is not faster
_OPERATOR_S = 0.2


class ControllerLink(Closing):
    """The connections to one game controller. Close it, or use it in a ``with`` statement.

    A lost connection is reported in `problems`, and the simulator goes on without it.

    Parameters
    ----------
    host : str
        Name or IPv4 address of the machine the game controller runs on.
    drives : bool
        Whether the game controller was started for continuous integration: it then uses the time and the true positions
        that the simulator sends.

    Raises
    ------
    ArgumentError
        If there is no connection.
    """

    def __init__(self, field: Field, host: str, *, drives: bool = False) -> None:
        self._field, self.drives = field, drives
        self._autoref = Autoref(field)
        self.problems = Problems()
        self.events = 0
        self._last_look_s = -math.inf
        self._frames = 0
        division = "DIV_A" if is_division_a(field) else "DIV_B"
        with ExitStack() as opened:
            self._client: AutoRefClient | None = opened.enter_context(AutoRefClient(IDENTIFIER, host))
            self._operator: Operator | None = opened.enter_context(Operator(host, division=division))
            self._ci: CiClient | None = opened.enter_context(CiClient(host)) if drives else None
            self._opened = opened.pop_all()

    def close(self) -> None:
        """Close all connections."""
        self._opened.close()

    def hear(self, packet: Referee, state: LeagueState) -> None:
        """Process a packet of the game controller."""
        self._autoref.hear(packet, state.t_s, state.ball)

    def drive(self, state: LeagueState, epoch_s: float) -> list[Referee]:
        """Send time and true positions to a driven game controller; return its packets."""
        if self._ci is None:
            return []
        geometry = geometry_from_field(self._field) if self._frames % STEPS_PER_S == 0 else None
        self._frames += 1
        packet = tracker_packet(state, self._frames, epoch_s)
        try:
            answers = self._ci.exchange(CiInput(round(NS_PER_S * (epoch_s + state.t_s)), packet, geometry=geometry))
        except (ArgumentError, PacketError) as error:
            self.problems.add(str(error))
            self._ci = None
            return []
        if not answers:
            self.problems.add("the game controller has left a moment unanswered")
        return answers

    def judge(self, state: LeagueState, epoch_s: float) -> None:
        """Report events to the game controller, and let the operator act."""
        now_s = epoch_s + state.t_s
        events = self._autoref.judge(state.t_s, state.robots, state.ball, now_s)
        try:
            if self._client is not None:
                for event in events:
                    self._client.tell(event)
                    self.events += 1
                self._client.listen()
                for words in self._client.problems.take_new():
                    self.problems.add(words)
        except (ArgumentError, PacketError) as error:
            self.problems.add(str(error))
            self._client = None
        if time.monotonic() - self._last_look_s < _OPERATOR_S or self._operator is None:
            return
        self._last_look_s = time.monotonic()
        try:
            self._operator.look(state.t_s if self.drives else None)
        except (ArgumentError, ValueError) as error:
            self.problems.add(str(error))
            self._operator = None
