"""What a team tells the game controller: who keeps the goal, and that the game shall go on when it was fouled."""

from __future__ import annotations

import math
from collections.abc import Collection

from field_models.errors import ArgumentError, PacketError
from robocup_vision.closing import Closing
from robocup_vision.ssl.controller_clients import TeamPortClient
from robocup_vision.ssl.problems import Problems
from robocup_vision.ssl.values.referee import Referee, RefereeCommand
from robocup_vision.ssl.values.simulation import Team

# a keeper that has not been seen for so long is not there; asked again after as long
_ABSENT_S, _AGAIN_S = 2.0, 5.0


class TeamDesk(Closing):
    """A team's connection to the game controller, made once it has told the team's name. Close it.

    Parameters
    ----------
    team : Team
        Yellow or blue.
    host : str
        Name or IPv4 address of the machine the game controller runs on.
    problems : Problems
        Told of what goes wrong; the team plays on.
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
        """Take in a packet of the game controller, with the numbers of the robots that are seen, at a time."""
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
