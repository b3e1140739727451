"""An automatic referee for a game controller: it reports events, and leaves the decisions to the game controller.

The events are found by a `LeagueReferee` that follows the game controller's commands.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from field_models import Field
from robocup_vision.ssl.values.controller import (
    ByRobot,
    EventKind,
    Goal,
    Place,
    PlacementSucceeded,
    RefereeEvent,
    referee_event,
)
from robocup_vision.ssl.values.referee import Referee, RefereeCommand
from robocup_vision.ssl.values.simulation import Team
from sim2d.match.league_referee import Command, Foul, LeagueReferee
from sim2d.match.pitch_rules import NextPlay, Restart
from sim2d.network.packets import COMMANDS, NEXT, US_PER_S
from sim2d.world.state import BallState, RobotState

K = EventKind
# the simulator's command for each command of the league, and the team whose turn it is
_COMMANDS: dict[RefereeCommand, tuple[Command, Team]] = {
    one: (command, Team.UNKNOWN if yellow == blue else team)
    for command, (yellow, blue) in COMMANDS.items()
    for one, team in ((yellow, Team.YELLOW), (blue, Team.BLUE))
}
_KINDS: dict[Command, Restart] = {command: kind for kind, command in NEXT.items()}
_FOULS = {
    "fast_in_stop": K.BOT_TOO_FAST_IN_STOP,
    "fast_ball": K.BOT_KICKED_BALL_TOO_FAST,
    "double_touch": K.ATTACKER_DOUBLE_TOUCHED_BALL,
    "own_area": K.DEFENDER_IN_DEFENSE_AREA,
    "their_area": K.ATTACKER_TOUCHED_BALL_IN_DEFENSE_AREA,
}


class Autoref:
    """Watches one match under a game controller."""

    def __init__(self, field: Field) -> None:
        self._referee = LeagueReferee(field, field.robot_radius_m, half_s=math.inf)
        self._field = field
        self._packet: Referee | None = None
        self._followed: tuple[Command, int, float, NextPlay | None, Restart] | None = None
        self._counter = 0
        self._reported: set[tuple[object, ...]] = set()
        self._begins: BallState | None = None
        self._highest_m = 0.0

    def hear(self, packet: Referee, t_s: float, ball: BallState) -> None:
        """Process a packet that the game controller sent at a time."""
        before, self._packet = self._packet, packet
        self._referee.keepers = {
            self._side(Team.YELLOW): packet.yellow.goalkeeper,
            self._side(Team.BLUE): packet.blue.goalkeeper,
        }
        if before is not None and (before.command_counter, before.command) == (packet.command_counter, packet.command):
            return
        command, team = _COMMANDS.get(packet.command, ("halt", Team.UNKNOWN))
        side, kind = self._side(team), _KINDS.get(command, "force_start")
        if command == "normal_start" and self._followed is not None and self._followed[0].startswith("prepare"):
            side, kind = self._followed[1], self._followed[4]
        self._followed = (command, side, t_s, self._coming(packet), kind)
        self._reported.clear()
        self._begins, self._highest_m = ball, 0.0
        self._follow(ball, is_in_play=False)

    def judge(self, t_s: float, robots: Sequence[RobotState], ball: BallState, now_s: float) -> list[RefereeEvent]:
        """Return the events since the last call, each once per command of the game controller.

        Parameters
        ----------
        t_s : float
            Present time, by the clock of `hear`.
        robots : sequence of RobotState
            All robots; yellow is side +1.
        now_s : float
            Present time since 1970, for the events' stamps.
        """
        if self._followed is None or self._packet is None:
            return []
        turned = self._side(Team.YELLOW)
        if turned < 0:
            robots = [replace(robot, side=-robot.side) for robot in robots]
        referee, before = self._referee, len(self._referee.fouls)
        command, side, since_s, _, _ = self._followed
        if math.hypot(ball.vx_mps, ball.vy_mps) < 0.1:
            self._highest_m = 0.0
        self._highest_m = max(self._highest_m, ball.z_m)
        last = referee.last_touch
        what: list[tuple[EventKind, ByRobot | Goal | PlacementSucceeded]] = []
        for ruling in referee.judge(t_s, robots, ball):
            event = ruling.event
            if event is not None and event.kind == "goal":
                what.append((K.POSSIBLE_GOAL, self._goal(event.side, referee.last_touch or last, robots, ball)))
            elif event is not None and event.kind == "ball_out":
                what.append(self._out(referee.last_touch or last, ball))
        for foul in referee.fouls[before:]:
            kind = self._kind_of(foul, command)
            if kind is not None:
                what.append((kind, self._by(foul.side, foul.number, robots, ball, kind)))
        if command == "ball_placement" and referee.command not in ("ball_placement", "stop"):
            what.append((K.PLACEMENT_SUCCEEDED, self._placed(side, t_s - since_s, ball)))
        if referee.command_counter != self._counter:
            # undo the referee's own decision
            self._follow(ball, is_in_play=True)
        out = []
        for kind, report in what:
            key = kind, report.team, getattr(report, "number", None)
            if key not in self._reported:
                self._reported.add(key)
                out.append(referee_event(kind, report, round(US_PER_S * now_s)))
        return out

    def _follow(self, ball: BallState, *, is_in_play: bool) -> None:
        if self._followed is None:
            return
        command, side, since_s, coming, kind = self._followed
        self._referee.follow(command, side, since_s, ball, coming, kind, is_in_play=is_in_play)
        self._counter = self._referee.command_counter

    def _side(self, team: Team) -> int:
        yellow = -1 if self._packet is not None and self._packet.blue_on_positive_half is False else 1
        return {Team.YELLOW: yellow, Team.BLUE: -yellow}.get(team, 0)

    def _team(self, side: int) -> Team:
        return Team.YELLOW if side == self._side(Team.YELLOW) else Team.BLUE

    def _coming(self, packet: Referee) -> NextPlay | None:
        place = packet.designated_position
        if place is None or not all(map(math.isfinite, (place.x_m, place.y_m))):
            return None
        coming = None if packet.next_command is None else _COMMANDS.get(packet.next_command)
        if coming is None:
            return NextPlay("force_start", 0, (place.x_m, place.y_m))
        return NextPlay(_KINDS.get(coming[0], "force_start"), self._side(coming[1]), (place.x_m, place.y_m))

    @staticmethod
    def _kind_of(foul: Foul, command: Command) -> EventKind | None:
        if foul.kind != "near_ball":
            return _FOULS[foul.kind]
        if command == "ball_placement":
            return K.BOT_INTERFERED_PLACEMENT
        # the game controller has no event for a robot near the ball in a stop
        return K.DEFENDER_TOO_CLOSE_TO_KICK_POINT if command in ("direct_free", "normal_start") else None

    def _by(self, side: int, number: int, robots: Sequence[RobotState], ball: BallState, kind: EventKind) -> ByRobot:
        robot = next((one for one in robots if (one.side, one.number) == (side, number)), None)
        amount = None
        place = (ball.x_m, ball.y_m)
        if kind == K.BOT_KICKED_BALL_TOO_FAST:
            amount = math.hypot(ball.vx_mps, ball.vy_mps)
        elif robot is not None:
            place = (robot.pose.x_m, robot.pose.y_m)
            if kind == K.BOT_TOO_FAST_IN_STOP:
                amount = math.hypot(*robot.velocity_mps)
            elif kind == K.DEFENDER_TOO_CLOSE_TO_KICK_POINT:
                amount = math.dist(place, (ball.x_m, ball.y_m))
        return ByRobot(self._team(side), number, Place(*place), amount)

    def _goal(self, side: int, last: tuple[int, int] | None, robots: Sequence[RobotState], ball: BallState) -> Goal:
        place, count = Place(ball.x_m, ball.y_m), sum(robot.side == side for robot in robots)
        kicking, number = (None, None) if last is None else (self._team(last[0]), last[1])
        return Goal(self._team(side), kicking, number, place, self._highest_m, count)

    def _out(self, last: tuple[int, int] | None, ball: BallState) -> tuple[EventKind, ByRobot]:
        over_goal_line = abs(ball.x_m) > self._field.length_m / 2
        kind = K.BALL_LEFT_FIELD_GOAL_LINE if over_goal_line else K.BALL_LEFT_FIELD_TOUCH_LINE
        side, number = last or (0, None)
        team = self._team(side) if side else Team.UNKNOWN
        return kind, ByRobot(team, number, Place(ball.x_m, ball.y_m))

    def _placed(self, side: int, took_s: float, ball: BallState) -> PlacementSucceeded:
        off_m = away_m = None
        coming = None if self._followed is None else self._followed[3]
        if coming is not None:
            off_m = math.dist(coming.place_m, (ball.x_m, ball.y_m))
            if self._begins is not None:
                away_m = math.dist(coming.place_m, (self._begins.x_m, self._begins.y_m))
        return PlacementSucceeded(self._team(side), took_s, off_m, away_m)
