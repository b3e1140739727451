"""Clients that ask one program and get its answer: a simulator's control, and the robots of a team.

They raise `ArgumentError` where the program cannot be reached or is lost, and `PacketError` where a number does not fit
into its field. Over a connection (`SyncClient`), `PacketError` is raised as well where what comes is no answer.
"""

from __future__ import annotations

import socket
from collections.abc import Sequence
from typing import TypeVar

from field_models.errors import ArgumentError
from robocup_vision.ssl.datagrams import DatagramClient
from robocup_vision.ssl.framed import FramedClient
from robocup_vision.ssl.protocol.mapping import encode
from robocup_vision.ssl.sockets import BLUE_PORT, LOOPBACK, SIMULATION_PORT, YELLOW_PORT, error_words
from robocup_vision.ssl.values.simulation import (
    RobotCommand,
    RobotControl,
    RobotControlResponse,
    RobotId,
    SimulatorCommand,
    SimulatorControl,
    SimulatorResponse,
    SyncRequest,
    SyncResponse,
    Team,
    TeleportBall,
    TeleportRobot,
)

ROBOT_PORTS = {Team.YELLOW: YELLOW_PORT, Team.BLUE: BLUE_PORT}

T = TypeVar("T")


class _Client(DatagramClient[T]):
    """Sends to one address and receives from there alone; see `DatagramClient`."""

    def __init__(self, answer: type[T], host: str, port: int) -> None:
        super().__init__(answer, socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        self._socket.setblocking(False)
        self._host, self._port = host, port
        try:
            self._socket.connect((host, port))
        except (OSError, OverflowError) as error:
            self._socket.close()
            raise ArgumentError(f"cannot reach {host}:{port}: {error_words(error)}") from None

    def _ask_step(self, request: SyncRequest, timeout_s: float) -> SyncResponse | None:
        self._send(request)
        return self._receive(SyncResponse, timeout_s)

    def _send(self, value: object) -> None:
        data = encode(value)
        try:
            self._socket.send(data)
        except ConnectionError:
            # is about the datagram before this one: nobody listened then
            self._socket.send(data)
        except OSError as error:
            raise ArgumentError(f"cannot send to {self._host}:{self._port}: {error_words(error)}") from None


class RobotClient(_Client[RobotControlResponse]):
    """Commands the robots of a team.

    Parameters
    ----------
    host : str
        Where the simulator or the radio runs.
    port : int, optional
        Default: the league's for that team.
    """

    def __init__(self, team: Team, host: str = LOOPBACK, port: int | None = None) -> None:
        if team not in ROBOT_PORTS:
            raise ArgumentError(f"team must be yellow or blue, got {team!r}")
        super().__init__(RobotControlResponse, host, port or ROBOT_PORTS[team])

    def send(self, commands: Sequence[RobotCommand]) -> None:
        """Send commands, at most one a robot. A robot without one for 0.1 s stands still."""
        self._send(RobotControl(tuple(commands)))

    def step(self, step_s: float, commands: Sequence[RobotCommand], timeout_s: float = 1.0) -> SyncResponse | None:
        """Let a simulator go on by a step with these commands; return what was seen, or None after a time."""
        return self._ask_step(SyncRequest(step_s, robot_control=RobotControl(tuple(commands))), timeout_s)


class SyncClient(FramedClient):
    """Steps a simulator over a connection (TCP), as the league's draft has it. Close it, or use it in a ``with``.

    Parameters
    ----------
    team : Team or None
        Whose robots are commanded; None: the control's port, which commands none.
    port : int, optional
        Default: the league's for that team.
    """

    def __init__(self, team: Team | None = None, host: str = LOOPBACK, port: int | None = None) -> None:
        if team is not None and team not in ROBOT_PORTS:
            raise ArgumentError(f"team must be yellow, blue or None, got {team!r}")
        usual = SIMULATION_PORT if team is None else ROBOT_PORTS[team]
        super().__init__("the simulator", host, port or usual)

    def step(
        self,
        step_s: float,
        commands: Sequence[RobotCommand] = (),
        command: SimulatorCommand | None = None,
        timeout_s: float = 5.0,
    ) -> SyncResponse:
        """Go on by a step; return what was seen then. Raises `ArgumentError` if no answer comes in time."""
        control = RobotControl(tuple(commands)) if commands else None
        self._send(SyncRequest(step_s, command, control))
        response = self._receive(SyncResponse, timeout_s)
        if response is None:
            raise ArgumentError(f"the simulator has not answered for {timeout_s:g} s")
        return response


class SimulatorClient(_Client[SimulatorResponse]):
    """Controls a simulator: puts things somewhere, changes its speed and settings, or steps it."""

    def __init__(self, host: str = LOOPBACK, port: int = SIMULATION_PORT) -> None:
        super().__init__(SimulatorResponse, host, port)

    def send(self, command: SimulatorCommand) -> None:
        """Send a command; a simulator answers one that held an error, and may answer others."""
        self._send(command)

    def step(
        self, step_s: float, command: SimulatorCommand | None = None, timeout_s: float = 1.0
    ) -> SyncResponse | None:
        """Let it go on by a step, a command first; return what was seen, or None after a time."""
        return self._ask_step(SyncRequest(step_s, command), timeout_s)

    def place_ball(self, x_m: float, y_m: float, vx_mps: float = 0.0, vy_mps: float = 0.0) -> None:
        """Put the ball on the floor somewhere."""
        ball = TeleportBall(x_m, y_m, 0.0, vx_mps, vy_mps, 0.0)
        self.send(SimulatorCommand(SimulatorControl(ball)))

    def place_robot(self, team: Team, number: int, x_m: float, y_m: float, orientation_rad: float) -> None:
        """Put a robot somewhere, at rest; one that is not on the field is put there."""
        robot = TeleportRobot(RobotId(number, team), x_m, y_m, orientation_rad, 0.0, 0.0, 0.0, True)
        self.send(SimulatorCommand(SimulatorControl(robots=(robot,))))

    def remove_robot(self, team: Team, number: int) -> None:
        """Take a robot off the field."""
        self.send(SimulatorCommand(SimulatorControl(robots=(TeleportRobot(RobotId(number, team), present=False),))))
