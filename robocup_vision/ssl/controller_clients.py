"""Clients of the game controller's ports for automatic referees (10007) and for teams (10008).

Both begin with a greeting and a registration; each message is replied to. Signatures are not made: a game controller
that knows a key of that name refuses the registration.
"""

from __future__ import annotations

import time
from typing import Generic, TypeVar

from field_models.errors import ArgumentError, PacketError
from robocup_vision.closing import Closing
from robocup_vision.ssl.framed import Framed, connect
from robocup_vision.ssl.problems import Problems
from robocup_vision.ssl.protocol.mapping import decode, encode
from robocup_vision.ssl.values.controller import (
    AdvantageChoice,
    AutoRefMessage,
    AutoRefRegistration,
    AutoRefReply,
    ControllerReply,
    RefereeEvent,
    ReplyStatus,
    TeamMessage,
    TeamRegistration,
    TeamReply,
)
from robocup_vision.ssl.values.referee import CiInput, CiOutput, Referee
from robocup_vision.ssl.values.simulation import Team

AUTOREF_PORT, TEAM_PORT = 10007, 10008
_TIMEOUT_S = 5.0
# replies are read after each message; nobody sends so many at once
_MAX_REPLIES = 100

R = TypeVar("R", AutoRefReply, TeamReply)
CI_PORT = 10009


class _ControllerClient(Closing, Generic[R]):
    """A registered connection. Close it, or use it in a ``with``.

    Attributes
    ----------
    problems : Problems
        What the game controller rejected, and why.
    """

    def __init__(self, name: str, reply: type[R], registration: object, host: str, port: int) -> None:
        self._name = f"{name} of the game controller at {host}:{port}"
        self._reply: type[R] = reply
        self.problems = Problems()
        self._connection = Framed(self._name, connect(name + " of a game controller", host, port, _TIMEOUT_S))
        try:
            self._must_accept()
            self._connection.send(encode(registration))
            self._must_accept()
        except BaseException:
            self._connection.close()
            raise

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()

    def listen(self) -> None:
        """Read the replies that have come; what was rejected is added to `problems`.

        Raises
        ------
        ArgumentError
            If the connection is lost.
        PacketError
            If what comes is no reply.
        """
        for _ in range(_MAX_REPLIES):
            reply = self._next(0.0)
            if reply is None:
                return
            if reply.status == ReplyStatus.REJECTED:
                self.problems.add(f"{self._name} rejects: {reply.reason}")

    def _send(self, message: object) -> None:
        self.listen()
        self._connection.send(encode(message))

    def _next(self, wait_s: float) -> ControllerReply | None:
        data = self._connection.receive(wait_s)
        return None if data is None else decode(self._reply, data).reply or ControllerReply()

    def _must_accept(self) -> None:
        try:
            reply = self._next(_TIMEOUT_S)
        except PacketError as error:
            raise ArgumentError(f"{self._name}: {error}") from None
        if reply is None:
            raise ArgumentError(f"{self._name} does not answer")
        if reply.status != ReplyStatus.OK:
            raise ArgumentError(f"{self._name} refuses: {reply.reason}")


class AutoRefClient(_ControllerClient[AutoRefReply]):
    """Tells a game controller what an automatic referee sees.

    Raises
    ------
    ArgumentError
        If there is no connection, or the game controller refuses it.
    """

    def __init__(self, identifier: str, host: str = "127.0.0.1", port: int = AUTOREF_PORT) -> None:
        super().__init__("the port for referees", AutoRefReply, AutoRefRegistration(identifier), host, port)

    def tell(self, event: RefereeEvent) -> None:
        """Tell an event.

        Raises
        ------
        ArgumentError
            If the connection is lost.
        """
        self._send(AutoRefMessage(event))


class TeamPortClient(_ControllerClient[TeamReply]):
    """Tells a game controller what a team wants.

    Parameters
    ----------
    team_name : str
        As the game controller has it.

    Raises
    ------
    ArgumentError
        If there is no connection, or the game controller refuses it.
    """

    def __init__(self, team_name: str, team: Team, host: str = "127.0.0.1", port: int = TEAM_PORT) -> None:
        super().__init__("the port for teams", TeamReply, TeamRegistration(team_name, team), host, port)

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


class CiClient(Closing):
    """A connection to a game controller. Close it, or use it in a ``with``.

    Parameters
    ----------
    timeout_s : float
        For the connection, and for what is sent.

    Raises
    ------
    ArgumentError
        If there is no connection.
    """

    def __init__(self, host: str = "127.0.0.1", port: int = CI_PORT, timeout_s: float = 5.0) -> None:
        name = "a game controller"
        self._connection = Framed(f"the game controller at {host}:{port}", connect(name, host, port, timeout_s))

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()

    def exchange(self, value: CiInput, wait_s: float = 1.0) -> list[Referee]:
        """Send an input, wait for an answer at most so long, and return all packets that have come.

        A game controller answers each input within milliseconds. One that hears of the next moment before it has done
        with this one may give the command that is due twice, and ends.

        Raises
        ------
        ArgumentError
            If the connection is lost.
        PacketError
            If what comes is no packet of a game controller, or larger than 8 MB.
        """
        self._connection.send(encode(value))
        end_s = time.monotonic() + wait_s
        packets: list[Referee] = []
        while True:
            frame = self._connection.receive(0.0 if packets else max(end_s - time.monotonic(), 0.0))
            if frame is None:
                return packets
            referee = decode(CiOutput, frame).referee
            if referee is not None:
                packets.append(referee)
