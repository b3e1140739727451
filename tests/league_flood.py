"""A flood of damaged messages from five senders against a simulator and a team that play on the loopback."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np

from benchmarks.worlds.damaged_messages import damaged_messages
from field_models import load_field
from robocup_vision.ssl.sockets import (
    LOOPBACK,
    MAX_DATAGRAM_BYTES,
    REFEREE_GROUP,
    TRACKER_GROUP,
    VISION_GROUP,
    multicast_sender,
)
from robocup_vision.ssl.values.simulation import Team
from sim2d.network.league import LeagueSimulator
from sim2d.network.realism import REALISMS
from sim2d.network.server import LeagueServer, Ports
from sim2d.network.team.client import TeamClient

_SENDERS = 5
# messages between two turns of the simulator, and turns between two of the team
_A_TURN, _A_COMMAND = 20, 10
# two seconds: whom to follow is in doubt until the flood's senders have been silent for one
_TURNS_AFTER = 600
# of all, how many are repeated until they are large
_LARGE_RATIO = 0.02


@dataclass(frozen=True, slots=True)
class Flooded:
    """What came of it.

    Parameters
    ----------
    sent : int
        Messages.
    refused : int
        Those that the simulator counted as none.
    steps : int
        Of the physics while they came.
    is_finite : bool
        Whether all that is on the field is somewhere.
    plays_on : bool
        Whether the simulator goes on by itself, and the team gets commands out, when they have ended.
    """

    sent: int
    refused: int
    steps: int
    is_finite: bool
    plays_on: bool


def flood(count: int, seed: int, ports: Ports, vision_port: int) -> Flooded:
    """Send messages to every port of a simulator and to what its team listens to; whatever ends either is raised."""
    rng = np.random.default_rng(seed)
    field = load_field("ssl_division_b")
    simulator = LeagueSimulator(field, 2, REALISMS["none"], seed)
    simulator.vision_port = vision_port
    targets = [(LOOPBACK, port) for port in (ports.control, ports.blue, ports.yellow)]
    targets += [(VISION_GROUP, vision_port), (TRACKER_GROUP, ports.tracker), (REFEREE_GROUP, ports.referee)]
    with ExitStack() as opened:
        server = opened.enter_context(LeagueServer(simulator, ports=ports))
        team = opened.enter_context(
            TeamClient(
                Team.YELLOW,
                field,
                vision_port=vision_port,
                referee_port=ports.referee,
                robot_port=ports.yellow,
            )
        )
        senders = [opened.enter_context(multicast_sender()) for _ in range(_SENDERS)]
        for number, data in enumerate(_messages(rng, count)):
            senders[number % _SENDERS].sendto(data, targets[rng.integers(len(targets))])
            if number % _A_TURN == 0:
                _turn(server)
            if number % (_A_TURN * _A_COMMAND) == 0:
                team.turn()
        refused, steps = simulator.bad_datagrams, simulator.world.steps
        simulator.vision_port = vision_port
        sent = team.sent
        for turn in range(_TURNS_AFTER):
            _turn(server)
            if turn % _A_COMMAND == 0:
                team.turn()
        return Flooded(
            count,
            refused,
            steps,
            all(map(math.isfinite, _numbers(simulator))),
            simulator.world.steps >= steps + _TURNS_AFTER - 50 and team.sent > sent,
        )


def _turn(server: LeagueServer) -> None:
    # a message may have stopped it, or made it slow
    server.simulator.speed = 1.0
    server.turn()


def _messages(rng: np.random.Generator, count: int) -> Iterator[bytes]:
    for _, data in damaged_messages(rng, count):
        if data and rng.random() < _LARGE_RATIO:
            yield (data * (MAX_DATAGRAM_BYTES // len(data) + 1))[: int(rng.integers(1, MAX_DATAGRAM_BYTES + 1))]
        else:
            yield data


def _numbers(simulator: LeagueSimulator) -> Iterator[float]:
    state = simulator.world.state
    yield from (state.ball.x_m, state.ball.y_m, state.ball.vx_mps, state.ball.vy_mps, state.ball.z_m)
    for robot in state.robots:
        yield from (robot.pose.x_m, robot.pose.y_m, robot.pose.theta_rad, *robot.velocity_mps, robot.turn_rps)
