"""Clients of the game controller's ports for automatic referees (10007), teams (10008) and simulators (10009).

The first two begin with a greeting and a registration, and each of their messages is replied to. Messages are not
signed: a game controller that has a key for that name refuses the registration. The clients raise `ArgumentError` if
there is no connection, or it is refused or lost, and `PacketError` for data that is not a message or above 8 MB.
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
# largest number of replies read at once, far more than are sent between two messages
_MAX_REPLIES = 100


class _ControllerClient(FramedClient):
    """A registered connection.

    Attributes
    ----------
    problems : Problems
        Messages that the game controller rejected, and why.
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
        """Read the replies that have arrived; rejections are added to `problems`."""
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
    """Reports the events that an automatic referee sees to a game controller."""

    def __init__(self, identifier: str, host: str = LOOPBACK, port: int = AUTOREF_PORT) -> None:
        super().__init__("the port for referees", AutoRefRegistration(identifier), host, port)

    def tell(self, event: RefereeEvent) -> None:
        """Report an event."""
        self._send(AutoRefMessage(event))


class TeamPortClient(_ControllerClient):
    """Sends a team's requests to a game controller.

    Parameters
    ----------
    team_name : str
        Name of the team as in the game controller.
    """

    def __init__(self, team_name: str, team: Team, host: str = LOOPBACK, port: int = TEAM_PORT) -> None:
        super().__init__("the port for teams", TeamRegistration(team_name, team), host, port)

    def change_keeper(self, number: int) -> None:
        """Ask for another goalkeeper, by its number; refused while the ball is in play in the own half."""
        self._send(TeamMessage(desired_keeper=number))

    def choose_advantage(self, *, goes_on: bool) -> None:
        """Choose whether the game goes on after a foul of the other team against this one."""
        self._send(TeamMessage(advantage_choice=AdvantageChoice.CONTINUE if goes_on else AdvantageChoice.STOP))

    def ask_for_substitution(self, *, wanted: bool = True) -> None:
        """Ask to exchange a robot at the next opportunity, or withdraw that request."""
        self._send(TeamMessage(substitute_robot=wanted))

    def ping(self) -> None:
        """Ask for a reply, so that a lost connection is noticed."""
        self._send(TeamMessage(ping=True))


class CiClient(FramedClient):
    """A connection to a game controller that was started for continuous integration."""

    def __init__(self, host: str = LOOPBACK, port: int = CI_PORT) -> None:
        super().__init__("the game controller", host, port)

    def exchange(self, value: CiInput, wait_s: float = 1.0) -> list[Referee]:
        """Send an input, wait at most `wait_s` for an answer, and return all packets that have arrived.

        A game controller answers each input within milliseconds. If it receives the next input before it has finished
        with this one, it may give the same command twice, and ends.
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
