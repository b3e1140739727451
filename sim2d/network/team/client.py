"""Plays a team on the network: receives vision and referee, and sends the robots 30 commands per second."""

from __future__ import annotations

import math
import select
import time
from collections.abc import Callable, Collection
from contextlib import ExitStack

from field_models import Field
from field_models.errors import ArgumentError, PacketError
from robocup_vision.closing import Closing
from robocup_vision.ssl.controller_clients import TeamPortClient
from robocup_vision.ssl.problems import Problems
from robocup_vision.ssl.requests import RobotClient
from robocup_vision.ssl.sockets import LOOPBACK, SIMULATED_VISION_PORT
from robocup_vision.ssl.subscriptions import RefereeClient, VisionClient
from robocup_vision.ssl.values.referee import Referee, RefereeCommand
from robocup_vision.ssl.values.simulation import Team
from sim2d.network.team.team import LIMITS, OverheadTeam
from sim2d.robot_link import CONTROL_PERIOD_S

# A larger apparent delay means that vision's clock differs from this machine's; then the usual delay is assumed.
_MAX_DELAY_S, _USUAL_DELAY_S = 0.2, 0.03
# time until a command is obeyed: half a period of the simulator, and the transmission
_COMMAND_DELAY_S = 0.01
# no commands are sent if vision is silent, or its clock does not advance, for this time: the robots then stop
_BLIND_S = 0.3
# greatest numbers of frames, two control periods of eight cameras, and of answers read at once
_MAX_FRAMES, _MAX_ANSWERS = 48, 100
# a keeper that has not been seen for the first time is absent; another one is requested, at most once in the second
_ABSENT_S, _AGAIN_S = 2.0, 5.0


class TeamClient(Closing):
    """Plays one team. Close it, or use it in a ``with``.

    Parameters
    ----------
    speed_mps : float
        The robots' greatest speed.
    interface : str
        Network interface on which vision and referee are received.
    robot_port : int, optional
        Default: the league's port for that team.
    controller_host : str, optional
        Host of a game controller, at which the team requests its keeper.

    Raises
    ------
    ArgumentError
        If the field has no goals, or an address cannot be used.
    """

    def __init__(
        self,
        team: Team,
        field: Field,
        *,
        speed_mps: float = LIMITS.speed_mps,
        host: str = LOOPBACK,
        interface: str = "loopback",
        vision_port: int = SIMULATED_VISION_PORT,
        referee_port: int = 10003,
        robot_port: int | None = None,
        controller_host: str | None = None,
    ) -> None:
        self.team = OverheadTeam(team, field, speed_mps)
        self.sent = 0
        with ExitStack() as opened:
            self._vision = opened.enter_context(VisionClient(vision_port, interface))
            self._referee = opened.enter_context(RefereeClient(referee_port, interface))
            self._robots = opened.enter_context(RobotClient(team, host, robot_port))
            self._desk: TeamDesk | None = None
            if controller_host is not None:
                self._desk = opened.enter_context(TeamDesk(team, controller_host, self.team.problems))
            self._opened = opened.pop_all()
        self._due_s = 0.0
        self._heard_s = -math.inf
        self._delay_s = _USUAL_DELAY_S
        self._bad: dict[str, int] = {}

    def close(self) -> None:
        """Close all sockets."""
        self._opened.close()

    @property
    def bad_datagrams(self) -> int:
        """Number of datagrams that could not be decoded."""
        return self._vision.bad_datagrams + self._referee.bad_datagrams + self._robots.bad_datagrams

    @property
    def is_blind(self) -> bool:
        """Whether vision has been silent, or its clock has not advanced, for `_BLIND_S`."""
        return time.monotonic() - self._heard_s > _BLIND_S

    @property
    def problems(self) -> Problems:
        """Problems with vision, referee and robots so far."""
        return self.team.problems

    def run(self, goes_on: Callable[[], bool]) -> None:
        """Play as long as `goes_on`, which is called before every command, returns true."""
        self._due_s = time.monotonic()
        while goes_on():
            self.turn()

    def turn(self) -> None:
        """Receive packets until the next commands are due, and send these."""
        sources: list[VisionClient | RefereeClient | RobotClient] = [self._vision, self._referee, self._robots]
        while True:
            left_s = self._due_s - time.monotonic()
            ready, _, _ = select.select(sources, [], [], max(left_s, 0.0))
            self._hear()
            if not ready or left_s <= 0:
                break
        # a machine that is too slow gives up the lost time instead of catching up
        self._due_s = max(self._due_s + CONTROL_PERIOD_S, time.monotonic())
        if self.is_blind:
            return
        now_s = self.team.seen_s + self._delay_s + (time.monotonic() - self._heard_s)
        commands = self.team.commands(now_s + _COMMAND_DELAY_S)
        if commands:
            self._robots.send(commands)
            self.sent += 1

    def _hear(self) -> None:
        # the referee first, so that a halt is obeyed however much vision sends
        for command in self._referee.receive_newest():
            self.team.hear_referee(command, self._referee.sender)
            if self._desk is not None:
                self._desk.hear(command, self.team.intents, time.monotonic())
        if self._referee.is_silent:
            self.team.lose_referee()
        skipped = self._vision.skipped
        for packet in self._vision.receive_newest(_MAX_FRAMES):
            before_s = self.team.seen_s
            self.team.hear_vision(packet)
            if packet.detection is not None and self.team.seen_s > before_s:
                self._heard_s = time.monotonic()
                delay_s = time.time() - packet.detection.t_capture_s
                self._delay_s = delay_s if 0 <= delay_s <= _MAX_DELAY_S else _USUAL_DELAY_S
        for answer in self._robots.receive_newest(_MAX_ANSWERS):
            self.team.hear_robots(answer)
        if self._vision.skipped > skipped:
            self.problems.add("this machine is too slow for vision", "vision came faster than it could be read")
        for problem in (self._referee.problem, self._vision.problem):
            if problem:
                self.problems.add(problem)
        for source, client in (("vision", self._vision), ("referee", self._referee), ("robots", self._robots)):
            bad = client.bad_datagrams
            if bad > self._bad.get(source, 0):
                self._bad[source] = bad
                self.problems.add(f"bad datagrams of {source}", f"from {source}: {client.last_problem}")


class TeamDesk(Closing):
    """The team's connection to the game controller: it chooses the keeper, and advantage after fouls by the opponent.

    It connects once the game controller has sent the team's name. The team plays on if anything here fails.
    """

    def __init__(self, team: Team, host: str, problems: Problems) -> None:
        self._team, self._host, self._problems = team, host, problems
        self._client: TeamPortClient | None = None
        self._is_done = False
        self._keeper_seen_s, self._asked_s = math.inf, -math.inf

    def close(self) -> None:
        """Close the connection."""
        if self._client is not None:
            self._client.close()

    def hear(self, packet: Referee, own: Collection[int], now_s: float) -> None:
        """Take in a packet of the game controller at a time; `own` are the numbers of the own robots that are seen."""
        if self._is_done:
            return
        try:
            self._hear(packet, own, now_s)
        except (ArgumentError, PacketError) as error:
            self._problems.add(str(error))
            self._is_done = True
            self.close()

    def _hear(self, packet: Referee, own: Collection[int], now_s: float) -> None:
        info = packet.yellow if self._team == Team.YELLOW else packet.blue
        if self._client is None:
            if not info.name or info.name == "Unknown":
                return
            self._client = TeamPortClient(info.name, self._team, self._host)
            self._client.choose_advantage(goes_on=True)
        self._client.listen()
        for words in self._client.problems.take_new():
            self._problems.add(words)
        if info.goalkeeper in own or not own or now_s < self._keeper_seen_s:
            self._keeper_seen_s = now_s
        stands = packet.command in (RefereeCommand.HALT, RefereeCommand.STOP)
        if stands and now_s - self._keeper_seen_s > _ABSENT_S and now_s - self._asked_s > _AGAIN_S:
            self._asked_s = now_s
            self._client.change_keeper(min(own))
