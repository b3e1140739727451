"""Built-in players of robots in the league's simulator: with cameras of their own, or by overhead vision."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from field_models import Field
from field_models.errors import ArgumentError
from robocup_vision.camera import PinholeCamera
from robocup_vision.geometry import Pose2
from robocup_vision.ssl.game import Game
from robocup_vision.ssl.values.detection import VisionPacket
from robocup_vision.ssl.values.referee import Referee
from robocup_vision.ssl.values.simulation import RobotControlResponse as Response
from robocup_vision.ssl.values.simulation import RobotFeedback as Feedback
from robocup_vision.ssl.values.simulation import Team
from sim2d.match.setups import setup_for
from sim2d.network.team.team import OverheadTeam, robot_command
from sim2d.network.world import MAX_NUMBER, SIDES, LeagueWorld
from sim2d.players.catalog import PLAYERS, player_factory
from sim2d.robot_link import Player, PlayerSetup, Senses
from sim2d.sensors.match_camera import MatchCamera
from sim2d.world.state import WorldState

OVERHEAD = "overhead"
_MAX_DELAY_S = 0.2


class OverheadRobots:
    """Robots that are played by the simulator's overhead vision, with its noise, as `robocup-vision play` does it."""

    sees_from_above = True

    def __init__(self, team: Team, numbers: tuple[int, ...], field: Field) -> None:
        self.team, self.numbers = team, numbers
        self._team = OverheadTeam(team, field)
        self._stamp_s = 0.0

    def begin(self, world: LeagueWorld) -> None:
        """Take over the robots; their specifications are not changed."""

    def hear_vision(self, packet: VisionPacket) -> None:
        """Take in a packet of overhead vision."""
        self._team.hear_vision(packet)
        if packet.detection is not None:
            self._stamp_s = packet.detection.t_capture_s

    def hear_referee(self, packet: Referee) -> None:
        """Process a packet of the referee."""
        self._team.hear_referee(packet)

    def lose_referee(self) -> None:
        """Stop until there are packets of the referee again."""
        self._team.lose_referee()

    def act(self, world: LeagueWorld, epoch_s: float) -> None:
        """Command the robots, once a control period."""
        there = [number for number in self.numbers if world.has(self.team, number)]
        self._team.hear_robots(
            Response(feedback=tuple(Feedback(number, world.touches_ball(self.team, number)) for number in there))
        )
        # vision's delay never exceeds this; a larger difference means that its clock has jumped
        ahead_s = min(max(epoch_s + world.t_s - self._stamp_s, 0.0), _MAX_DELAY_S)
        for command in self._team.commands(self._team.seen_s + ahead_s):
            if command.number in there:
                world.command(self.team, command)


class CameraRobots:
    """Robots with a camera each, played by sim2d's players, with the same limits as in its own matches.

    Parameters
    ----------
    numbers : tuple of int
        Numbers of the robots; the first keeps the goal if there are several.
    players : str
        ``plain``, ``memory`` or ``planning``.
    seed : int
        Seed of noise and of the players' random choices.
    """

    sees_from_above = False

    def __init__(self, team: Team, numbers: tuple[int, ...], field: Field, players: str, seed: int = 0) -> None:
        self.team, self.numbers = team, numbers
        self._field, self._side = field, SIDES[team]
        setup = setup_for(field)
        self._limits, self._camera = setup.robot.limits, setup.camera
        self._eyes = MatchCamera(field, self._camera, self._limits, np.random.default_rng([seed, int(team), 1]))
        self._game = Game(team)
        make = player_factory(players)
        count = len(numbers)
        seeds = np.random.default_rng([seed, int(team), 2]).integers(2**31, size=count).tolist()
        self._players: dict[int, Player] = {
            number: make(PlayerSetup(field, self._camera, self._limits, self._side, place, count, seeds[place]))
            for place, number in enumerate(numbers)
        }
        self._before: dict[int, Pose2] = {}
        self._pan_rad = dict.fromkeys(numbers, 0.0)

    def begin(self, world: LeagueWorld) -> None:
        """Take over the robots, and reduce their limits to those that the players assume."""
        for number in self.numbers:
            world.set_spec(self.team, number, world.spec(self.team, number).limited(self._limits))

    def hear_vision(self, packet: VisionPacket) -> None:
        """Do nothing: the robots have their own cameras."""

    def hear_referee(self, packet: Referee) -> None:
        """Process a packet of the referee."""
        self._game.update(packet)

    def lose_referee(self) -> None:
        """Stop until there are packets of the referee again."""
        self._game.lose_referee()

    def act(self, world: LeagueWorld, epoch_s: float) -> None:
        """Command the robots, once a control period."""
        truth = world.state
        # the state of a match, as far as the renderer uses it
        state = WorldState(truth.t_s, truth.robots, truth.ball, (0, 0), "play", 1, ())
        game = self._game.state(truth.t_s, (truth.ball.x_m, truth.ball.y_m))
        for robot in state.robots:
            if robot.side != self._side or robot.number not in self._players:
                continue
            number = robot.number
            index_state = dataclasses.replace(robot, pan_rad=self._pan_rad[number])
            robots = tuple(index_state if other.index == robot.index else other for other in state.robots)
            frame = self._eyes.render(dataclasses.replace(state, robots=robots), robot.index)
            before = self._before.get(number, robot.pose)
            self._before[number] = robot.pose
            senses = Senses(
                truth.t_s,
                frame,
                truth.t_s,
                before.inverse().compose(robot.pose),
                world.touches_ball(self.team, number),
                game.phase,
                game.own_turn,
                self._pan_rad[number] if isinstance(self._camera, PinholeCamera) else None,
                game.placement_m,
            )
            command = self._players[number].act(senses)
            if command.pan_rad is not None:
                self._pan_rad[number] = command.pan_rad
            world.command(self.team, robot_command(number, command))


BuiltInRobots = OverheadRobots | CameraRobots


def built_in_robots(text: str, field: Field, players: int, seed: int = 0) -> BuiltInRobots:
    """Return the robots that a text names: ``TEAM=KIND``, or ``TEAM=KIND:0,2,3`` for some robots of the team.

    Raises `ArgumentError` for another text.

    Parameters
    ----------
    text : str
        Team ``yellow`` or ``blue``; kind ``overhead``, ``plain``, ``memory`` or ``planning``.
    players : int
        Number of robots of each team, if the text has no numbers.
    seed : int
        Seed of noise and of the players' random choices.
    """
    team_name, equals, rest = text.partition("=")
    kind, colon, numbers_text = rest.partition(":")
    teams = {"yellow": Team.YELLOW, "blue": Team.BLUE}
    if not equals or team_name not in teams:
        raise ArgumentError(f"built-in players are given as yellow=KIND or blue=KIND, got {text!r}")
    if kind != OVERHEAD and kind not in PLAYERS:
        raise ArgumentError(f"there are no built-in players {kind!r}, only {', '.join((OVERHEAD, *PLAYERS))}")
    numbers = _numbers(numbers_text, text) if colon else tuple(range(players))
    team = teams[team_name]
    if kind == OVERHEAD:
        return OverheadRobots(team, numbers, field)
    return CameraRobots(team, numbers, field, kind, seed)


def _numbers(text: str, whole: str) -> tuple[int, ...]:
    try:
        numbers = tuple(sorted({int(part) for part in text.split(",")}))
    except ValueError:
        numbers = ()
    if not numbers or not all(0 <= number <= MAX_NUMBER for number in numbers):
        raise ArgumentError(f"robots' numbers are from 0 to {MAX_NUMBER}, apart by commas, got {whole!r}")
    return numbers


def check_apart(robots: Sequence[BuiltInRobots]) -> None:
    """Raise `ArgumentError` if a robot is named twice."""
    seen: set[tuple[Team, int]] = set()
    for group in robots:
        for number in group.numbers:
            if (group.team, number) in seen:
                raise ArgumentError(f"robot {number} of {group.team.name.lower()} has two built-in players")
            seen.add((group.team, number))
