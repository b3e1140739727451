"""Clients that send requests to one program and receive its answers: a simulator's control, and a team's robots.

They raise `ArgumentError` if the program cannot be reached or is lost, and `PacketError` if a number does not fit into
its field. `SyncClient`, which uses a connection, raises `PacketError` also if it receives anything but an answer.
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
    """Sends to one address and receives only from there; see `DatagramClient`."""

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
            # the error refers to the previous datagram, which no program received
            self._socket.send(data)
        except OSError as error:
            raise ArgumentError(f"cannot send to {self._host}:{self._port}: {error_words(error)}") from None


class RobotClient(_Client[RobotControlResponse]):
    """Commands the robots of a team.

    Parameters
    ----------
    host : str
        Machine on which the simulator or the radio runs.
    port : int, optional
        Default: the league's port for that team.
    """

    def __init__(self, team: Team, host: str = LOOPBACK, port: int | None = None) -> None:
        if team not in ROBOT_PORTS:
            raise ArgumentError(f"team must be yellow or blue, got {team!r}")
        super().__init__(RobotControlResponse, host, port or ROBOT_PORTS[team])

    def send(self, commands: Sequence[RobotCommand]) -> None:
        """Send commands, at most one per robot. A robot without a command for 0.1 s stops."""
        self._send(RobotControl(tuple(commands)))

    def step(self, step_s: float, commands: Sequence[RobotCommand], timeout_s: float = 1.0) -> SyncResponse | None:
        """Advance a simulator by a step with these commands; return its response, or None after the timeout."""
        return self._ask_step(SyncRequest(step_s, robot_control=RobotControl(tuple(commands))), timeout_s)


class SyncClient(FramedClient):
    """Steps a simulator over TCP, by the league's draft. Close it, or use it in a ``with`` statement.

    Parameters
    ----------
    team : Team or None
        Team whose robots are commanded; None: the simulator's control port, which does not command robots.
    port : int, optional
        Default: the league's port for that team or for control.
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
        """Advance the simulator by a step; return its response. Raises `ArgumentError` if none arrives in time."""
        control = RobotControl(tuple(commands)) if commands else None
        self._send(SyncRequest(step_s, command, control))
        response = self._receive(SyncResponse, timeout_s)
        if response is None:
            raise ArgumentError(f"the simulator has not answered for {timeout_s:g} s")
        return response


class SimulatorClient(_Client[SimulatorResponse]):
    """Controls a simulator: moves ball and robots, changes its speed and settings, or steps it."""

    def __init__(self, host: str = LOOPBACK, port: int = SIMULATION_PORT) -> None:
        super().__init__(SimulatorResponse, host, port)

    def send(self, command: SimulatorCommand) -> None:
        """Send a command; a simulator answers one with an error, and may answer others."""
        self._send(command)

    def step(
        self, step_s: float, command: SimulatorCommand | None = None, timeout_s: float = 1.0
    ) -> SyncResponse | None:
        """Advance the simulator by a step after a command; return its response, or None after the timeout."""
        return self._ask_step(SyncRequest(step_s, command), timeout_s)

    def place_ball(self, x_m: float, y_m: float, vx_mps: float = 0.0, vy_mps: float = 0.0) -> None:
        """Put the ball at a place on the floor."""
        ball = TeleportBall(x_m, y_m, 0.0, vx_mps, vy_mps, 0.0)
        self.send(SimulatorCommand(SimulatorControl(ball)))

    def place_robot(self, team: Team, number: int, x_m: float, y_m: float, orientation_rad: float) -> None:
        """Put a robot at a place, at rest; it is added if it is not on the field."""
        robot = TeleportRobot(RobotId(number, team), x_m, y_m, orientation_rad, 0.0, 0.0, 0.0, True)
        self.send(SimulatorCommand(SimulatorControl(robots=(robot,))))

    def remove_robot(self, team: Team, number: int) -> None:
        """Take a robot off the field."""
        self.send(SimulatorCommand(SimulatorControl(robots=(TeleportRobot(RobotId(number, team), present=False),))))
