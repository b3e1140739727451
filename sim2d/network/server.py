"""The simulator's sockets and clock: publishes packets when they are due, and answers requests in between.

One thread does all of this. Between two steps of the physics, requests are read for a limited time: a client that
floods a port loses datagrams and does not slow the others. A step is computed shortly before it is due, so that its
packets are sent at the time that they describe, independent of the computing time.
"""

from __future__ import annotations

import gc
import math
import select
import socket
import time
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass

from field_models.errors import PacketError
from robocup_vision.closing import Closing
from robocup_vision.ssl.problems import Problems
from robocup_vision.ssl.protocol.mapping import decode
from robocup_vision.ssl.sockets import (
    LOOPBACK,
    MAX_DATAGRAM_BYTES,
    REFEREE_GROUP,
    REFEREE_PORT,
    SIMULATION_PORT,
    TRACKER_GROUP,
    TRACKER_PORT,
    VISION_GROUP,
    interface_address,
    multicast_receiver,
    multicast_sender,
    server,
)
from robocup_vision.ssl.source_choice import SourceChoice
from robocup_vision.ssl.values.referee import Referee
from robocup_vision.ssl.values.simulation import Team
from sim2d.network.controller_link import ControllerLink
from sim2d.network.league import MAX_REQUEST_BYTES, STEPS_A_COMMAND, STEPS_A_FRAME, Channel, LeagueSimulator
from sim2d.network.packets import REFEREE_SOURCE
from sim2d.network.sync_server import SyncServer
from sim2d.world.physics import STEP_S

# largest difference between time stamps and this machine's clock
_CLOCK_OFF_S = 0.0005


# time for requests between two steps: a step of the physics takes 0.2 ms, a period 3.3 ms
_REQUEST_TIME_S = 0.002
# a server that is later than this gives up the lost time instead of catching up
_MAX_BEHIND_S = 0.25
# time by which a step is computed before it is due, 1 ms for 11 against 11; later requests wait for the next step
_AHEAD_S = 0.002
# a sleep may end late by about this: the last part of a wait is a busy loop
_SPIN_S = 0.0003
# longest single wait for requests, also while the simulation is paused
_PAUSED_WAIT_S = 0.05
# at infinite speed, requests are answered after this number of steps
_REQUEST_STEPS = 5
# number of stored latenesses of vision packets: about half an hour
_LATENESSES = 100_000


@dataclass(frozen=True, slots=True)
class Ports:
    """The ports on which the simulator listens and publishes, except vision's, which clients can change.

    That one is `LeagueSimulator.vision_port`.
    """

    #: Port of the simulation control; blue robots are commanded at the next port, yellow ones at the one after.
    control: int = SIMULATION_PORT
    #: Ports of the multicast groups of tracker and referee.
    tracker: int = TRACKER_PORT
    referee: int = REFEREE_PORT

    @property
    def blue(self) -> int:
        """Port of the blue robots."""
        return self.control + 1

    @property
    def yellow(self) -> int:
        """Port of the yellow robots."""
        return self.control + 2


class LeagueServer(Closing):
    """Serves a simulator on the network. Close it, or use it in a ``with``.

    Parameters
    ----------
    interface : str
        ``loopback``, a network interface's name or its IPv4 address. Requests are accepted on the loopback, too.
    controller : ControllerLink, optional
        A game controller, for which the simulator detects events and places the ball.
    own_referee_returns : bool
        Whether the simulator's own referee takes over when a game controller has become silent. By default it does
        not: a match that continues by itself after the controller has crashed would surprise its users.

    Attributes
    ----------
    lateness_s : deque of float
        Delays of the last vision packets.
    behind_s : float
        Total time that was given up because the machine was too slow.
    problems : Problems
        Problems with received packets.

    Raises
    ------
    ArgumentError
        If the interface does not exist or a port cannot be opened.
    """

    def __init__(
        self,
        simulator: LeagueSimulator,
        interface: str = "loopback",
        ports: Ports = Ports(),
        controller: ControllerLink | None = None,
        *,
        own_referee_returns: bool = False,
    ) -> None:
        self.simulator, self.ports = simulator, ports
        self._own_referee_returns = own_referee_returns
        self.lateness_s: deque[float] = deque(maxlen=_LATENESSES)
        self.behind_s = 0.0
        self.problems = Problems() if controller is None else controller.problems
        self._controller = controller
        self._referees = SourceChoice("referee packets")
        self._heard_referee = False
        self._speed = simulator.speed
        self._anchor_s, self._anchor_step = time.monotonic(), simulator.world.steps
        self._sockets: dict[socket.socket, Team | None] = {}
        teams = {ports.control: None, ports.blue: Team.BLUE, ports.yellow: Team.YELLOW}
        with ExitStack() as opened:
            self._sender = opened.enter_context(multicast_sender(interface, VISION_GROUP, TRACKER_GROUP, REFEREE_GROUP))
            self._referee = opened.enter_context(multicast_receiver(REFEREE_GROUP, ports.referee, interface))
            addresses = dict.fromkeys((LOOPBACK, interface_address(interface)))
            for address in addresses:
                for port, team in teams.items():
                    self._sockets[opened.enter_context(server(port, address))] = team
            self._sync = opened.enter_context(SyncServer(addresses, teams, MAX_REQUEST_BYTES))
            self._opened = opened.pop_all()

    def close(self) -> None:
        """Close all sockets."""
        self._opened.close()

    def run(self, goes_on: Callable[[], bool]) -> None:
        """Serve as long as `goes_on`, which is called before every step, returns true."""
        # frozen objects are skipped by later garbage collections, which then take much less time
        gc.collect()
        gc.freeze()
        try:
            self._anchor()
            while goes_on():
                self.turn()
        finally:
            gc.unfreeze()

    def turn(self) -> None:
        """Answer requests until the next step is due, and take the step; while paused, only answer for a while."""
        simulator = self.simulator
        if simulator.speed != self._speed:
            self._speed = simulator.speed
            self._anchor()
        if self._speed == 0:
            self._answer(_PAUSED_WAIT_S)
            return
        if math.isinf(self._speed):
            if simulator.world.steps % _REQUEST_STEPS == 0:
                self._answer(0.0)
            self._take_step(None)
            return
        due_s = self._due_s()
        ahead_s = min(_AHEAD_S, 0.5 * STEP_S / self._speed)
        while (left_s := due_s - ahead_s - time.monotonic()) > 0:
            self._answer(min(left_s, _PAUSED_WAIT_S))
            if simulator.speed != self._speed:
                return
        self._answer(0.0)
        if simulator.speed != self._speed or self._due_s() != due_s:
            return
        if time.monotonic() - due_s > _MAX_BEHIND_S:
            self.behind_s += time.monotonic() - due_s
            self._anchor()
            due_s = self._due_s()
        self._take_step(due_s)

    def _anchor(self) -> None:
        self._anchor_s, self._anchor_step = time.monotonic(), self.simulator.world.steps

    def _due_s(self) -> float:
        return self._anchor_s + (self.simulator.world.steps + 1 - self._anchor_step) * STEP_S / self._speed

    def _take_step(self, due_s: float | None) -> None:
        simulator = self.simulator
        if self._heard_referee and self._referees.is_silent(time.monotonic()):
            simulator.lose_referee()
            self._heard_referee = not self._own_referee_returns
        simulator.publishes_referee = not self._heard_referee
        if due_s is not None and self._speed == 1:
            # keep simulated time equal to the machine's clock, also after pauses and changes of the clock
            epoch_s = due_s + (time.time() - time.monotonic()) - (simulator.world.steps + 1) * STEP_S
            if abs(epoch_s - simulator.epoch_s) > _CLOCK_OFF_S:
                simulator.epoch_s = epoch_s
        packets = simulator.step()
        if self._controller is not None:
            self._serve_controller(self._controller)
        if due_s is not None:
            _wait_until(due_s)
        self._publish(packets, due_s)

    def _serve_controller(self, controller: ControllerLink) -> None:
        simulator = self.simulator
        if simulator.world.steps % STEPS_A_FRAME == 0:
            for packet in controller.drive(simulator.world.state, simulator.epoch_s):
                self._follow_referee(packet, None)
        if simulator.world.steps % STEPS_A_COMMAND == 0:
            controller.judge(simulator.world.state, simulator.epoch_s)

    def _publish(self, packets: list[tuple[Channel, bytes]], due_s: float | None) -> None:
        addresses = {
            Channel.VISION: (VISION_GROUP, self.simulator.vision_port),
            Channel.TRACKER: (TRACKER_GROUP, self.ports.tracker),
            Channel.REFEREE: (REFEREE_GROUP, self.ports.referee),
        }
        # vision first, since clients wait for it
        for channel, data in sorted(packets, key=lambda packet: packet[0] is not Channel.VISION):
            try:
                self._sender.sendto(data, addresses[channel])
            except (BlockingIOError, OSError):
                # a full queue or an interface that is down: the next packet replaces this one
                continue
            if due_s is not None and channel is Channel.VISION:
                self.lateness_s.append(time.monotonic() - due_s)

    def _answer(self, wait_s: float) -> None:
        """Wait for requests for at most `wait_s`, and answer those that have arrived, for a limited time."""
        steps = self._sync.sockets
        ready, _, _ = select.select([self._referee, *self._sockets, *steps], [], [], wait_s)
        if not ready:
            return
        begin_s = time.monotonic()
        for place, listening in enumerate(ready, 1):
            # each socket has its own share of the time, which a flooded port cannot take from the others
            end_s = begin_s + _REQUEST_TIME_S * place / len(ready)
            if listening in steps:
                self._sync.serve(listening, self._answer_step)
                continue
            while time.monotonic() < end_s:
                try:
                    data, peer = listening.recvfrom(MAX_DATAGRAM_BYTES)
                except (BlockingIOError, ConnectionRefusedError):
                    break
                if listening is self._referee:
                    self._hear_referee(data, (peer[0], peer[1]))
                    continue
                team = self._sockets[listening]
                if team is None:
                    answer, published = self.simulator.answer_control(data)
                else:
                    answer, published = self.simulator.answer_robots(team, data)
                self._publish(published, None)
                if answer is not None:
                    self._send_back(listening, answer, peer)

    def _answer_step(self, team: Team | None, data: bytes) -> bytes:
        answer, published = self.simulator.answer_step(team, data)
        self._publish(published, None)
        return answer

    def _hear_referee(self, data: bytes, sender: tuple[str, int]) -> None:
        try:
            packet = decode(Referee, data)
        except PacketError as error:
            self.problems.add("bad datagrams of the referee", f"from the referee's group: {error}")
            return
        # a controller that the simulator drives has already returned the same packet as its answer
        if packet.source_identifier != REFEREE_SOURCE and not (
            self._controller is not None and self._controller.drives
        ):
            self._follow_referee(packet, sender)

    def _follow_referee(self, packet: Referee, sender: tuple[str, int] | None) -> None:
        if self._referees.hear((packet.source_identifier, sender), time.monotonic()):
            self._heard_referee = True
            self.simulator.hear_referee(packet)
            if self._controller is not None:
                self._controller.hear(packet, self.simulator.world.state)
        if self._referees.problem:
            self.problems.add(self._referees.problem)

    @staticmethod
    def _send_back(listening: socket.socket, answer: bytes, peer: tuple[str, int]) -> None:
        try:
            listening.sendto(answer, peer)
        except (BlockingIOError, OSError):
            # the client has gone, or does not read
            return


def _wait_until(due_s: float) -> None:
    left_s = due_s - time.monotonic()
    if left_s > _SPIN_S:
        time.sleep(left_s - _SPIN_S)
    while time.monotonic() < due_s:
        pass
