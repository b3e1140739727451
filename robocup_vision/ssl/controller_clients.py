"""Clients of the game controller's ports for automatic referees (10007), teams (10008) and simulators (10009).

The first two begin with a greeting and a registration, and each of their messages is replied to. They sign nothing: a
game controller that knows a key of that name refuses the registration. They raise
`ArgumentError` where there is no connection, or it is refused or lost, and `PacketError` where what comes is no message
or larger than 8 MB.
"""

from __future__ import annotations

import time

from field_models.errors import ArgumentError, PacketError
from robocup_vision.ssl.framed import TIMEOUT_S, FramedClient
from robocup_vision.ssl.problems import Problems
from robocup_vision.ssl.sockets import LOOPBACK
from robocup_vision.ssl.values.controller import (
    AdvantageChoice,
    AutoRefMessage,
    AutoRefRegistration,
    ControllerMessage,
    ControllerReply,
    RefereeEvent,
    ReplyStatus,
    TeamMessage,
    TeamRegistration,
)
from robocup_vision.ssl.values.referee import CiInput, CiOutput, Referee
from robocup_vision.ssl.values.simulation import Team

AUTOREF_PORT, TEAM_PORT, CI_PORT = 10007, 10008, 10009
# replies are read after each message; nobody sends so many at once
_MAX_REPLIES = 100


class _ControllerClient(FramedClient):
    """A registered connection.

    Attributes
    ----------
    problems : Problems
        What the game controller rejected, and why.
    """

    def __init__(self, name: str, registration: object, host: str, port: int) -> None:
        super().__init__(f"{name} of the game controller", host, port)
        self.problems = Problems()
        try:
            self._must_accept()
            super()._send(registration)
            self._must_accept()
        except BaseException:
            self.close()
            raise

    def listen(self) -> None:
        """Read the replies that have come; what was rejected is added to `problems`."""
        for _ in range(_MAX_REPLIES):
            reply = self._next(0.0)
            if reply is None:
                return
            if reply.status == ReplyStatus.REJECTED:
                self.problems.add(f"{self._name} rejects: {reply.reason}")

    def _send(self, value: object) -> None:
        self.listen()
        super()._send(value)

    def _next(self, wait_s: float) -> ControllerReply | None:
        message = self._receive(ControllerMessage, wait_s)
        return None if message is None else message.reply or ControllerReply()

    def _must_accept(self) -> None:
        try:
            reply = self._next(TIMEOUT_S)
        except PacketError as error:
            raise ArgumentError(f"{self._name}: {error}") from None
        if reply is None:
            raise ArgumentError(f"{self._name} does not answer")
        if reply.status != ReplyStatus.OK:
            raise ArgumentError(f"{self._name} refuses: {reply.reason}")


class AutoRefClient(_ControllerClient):
    """Tells a game controller what an automatic referee sees."""

    def __init__(self, identifier: str, host: str = LOOPBACK, port: int = AUTOREF_PORT) -> None:
        super().__init__("the port for referees", AutoRefRegistration(identifier), host, port)

    def tell(self, event: RefereeEvent) -> None:
        """Tell an event."""
        self._send(AutoRefMessage(event))


class TeamPortClient(_ControllerClient):
    """Tells a game controller what a team wants.

    Parameters
    ----------
    team_name : str
        As the game controller has it.
    """

    def __init__(self, team_name: str, team: Team, host: str = LOOPBACK, port: int = TEAM_PORT) -> None:
        super().__init__("the port for teams", TeamRegistration(team_name, team), host, port)

    def change_keeper(self, number: int) -> None:
        """Ask for another goalkeeper, by its number; refused while the ball is in play in the own half."""
        self._send(TeamMessage(desired_keeper=number))

    def choose_advantage(self, *, goes_on: bool) -> None:
        """Say whether the game shall go on when the other team has fouled this one."""
        self._send(TeamMessage(advantage_choice=AdvantageChoice.CONTINUE if goes_on else AdvantageChoice.STOP))

    def ask_for_substitution(self, *, wanted: bool = True) -> None:
        """Ask to exchange a robot at the next opportunity, or no longer."""
        self._send(TeamMessage(substitute_robot=wanted))

    def ping(self) -> None:
        """Ask for a reply, so that a lost connection shows."""
        self._send(TeamMessage(ping=True))


class CiClient(FramedClient):
    """A connection to a game controller that was started for continuous integration."""

    def __init__(self, host: str = LOOPBACK, port: int = CI_PORT) -> None:
        super().__init__("the game controller", host, port)

    def exchange(self, value: CiInput, wait_s: float = 1.0) -> list[Referee]:
        """Send an input, wait for an answer at most so long, and return all packets that have come.

        A game controller answers each input within milliseconds. One that hears of the next moment before it has done
        with this one may give the command that is due twice, and ends.
        """
        self._send(value)
        end_s = time.monotonic() + wait_s
        packets: list[Referee] = []
        while True:
            output = self._receive(CiOutput, 0.0 if packets else max(end_s - time.monotonic(), 0.0))
            if output is None:
                return packets
            if output.referee is not None:
                packets.append(output.referee)
