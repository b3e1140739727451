"""Plays a match: in every control period each player gets only its robot's senses and returns a command.

A player that fails is stopped; the match goes on.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.camera import Rig
from robocup_vision.estimates import NotLocated
from sim2d.match.arena import Arena
from sim2d.match.disturbances import Disturbances
from sim2d.match.setups import Camera, RobotKind
from sim2d.players.built_in import BuiltInPlayer
from sim2d.rendering.sensor import Sensor
from sim2d.report.match_figures import MatchFigures, MatchLog
from sim2d.robot_link import (
    CONTROL_PERIOD_S,
    Command,
    Player,
    PlayerFactory,
    PlayerSetup,
    PlayerStatus,
    RobotLimits,
    Senses,
)
from sim2d.sensors.faults import Fault
from sim2d.sensors.match_camera import MATCH_SENSOR
from sim2d.sensors.team_channel import check_message
from sim2d.world.referee import RefereeFactory
from sim2d.world.state import Moment, RobotMoment
from sim2d.world.world import WorldSettings, check_command

_REASON_LETTERS = 200


class Seat:
    """Holds one player, and stops it when it fails."""

    def __init__(self, make: PlayerFactory, setup: PlayerSetup) -> None:
        self._player: Player | None = None
        self._stopped = ""
        try:
            self._player = make(setup)
        except (Exception, SystemExit) as error:
            self._stop(error)

    def act(self, senses: Senses) -> RobotMoment:
        """Let the player act; once it has failed, its robot stands still."""
        if self._player is not None:
            try:
                command = _checked(self._player.act(senses))
                return RobotMoment(senses, _checked_status(self._player.status), command, "")
            except (Exception, SystemExit) as error:
                self._stop(error)
        return RobotMoment(
            senses, PlayerStatus(NotLocated("its player was stopped"), None, "stopped", None), Command(), self._stopped
        )

    def _stop(self, error: BaseException) -> None:
        # only the text is kept: the error's traceback would keep the player and its frames in memory
        text = " ".join(f"{type(error).__name__}: {error}".split())
        self._stopped = text[:_REASON_LETTERS]
        self._player = None


def _checked(command: object) -> Command:
    """Return a command with its values as plain Python numbers.

    Raises
    ------
    TypeError, ArgumentError
        If it is not a command, or not one that a robot can carry out.
    """
    if not isinstance(command, Command):
        raise TypeError(f"the command is a {type(command).__name__}, no Command")
    plain = Command(
        float(command.forward_mps),
        float(command.left_mps),
        float(command.turn_rps),
        float(command.kick_mps),
        bool(command.dribble),
        None if command.pan_rad is None else float(command.pan_rad),
        command.message,
    )
    if plain.message is not None:
        check_message(plain.message)
    check_command(plain)
    return plain


def _checked_status(status: object) -> PlayerStatus:
    if not isinstance(status, PlayerStatus):
        raise TypeError(f"the status is a {type(status).__name__}, no PlayerStatus")
    if status.pose and not all(map(math.isfinite, status.pose.pose.array)):
        raise ArgumentError(f"the status' pose must be finite, got {status.pose.pose}")
    return status


class Match:
    """Plays a match, one control period after the other.

    Parameters
    ----------
    seed : int
        The same seed gives the same match, bit for bit.
    ours, theirs : PlayerFactory
        Make the players of the side that attacks the goal at +x, and of the other.
    field, players, camera, robot, limits, faults, physics, sensor, referee, disturbances
        As in `Arena`.
    keeps_figures : bool
        Whether to collect what `figures` returns; this takes some memory for each control period.

    Raises
    ------
    ArgumentError
        As `Arena`.
    """

    def __init__(
        self,
        field: Field,
        players: int | None = None,
        seed: int = 0,
        *,
        ours: PlayerFactory = BuiltInPlayer,
        theirs: PlayerFactory = BuiltInPlayer,
        camera: Camera | Rig | None = None,
        robot: RobotKind | None = None,
        limits: RobotLimits | None = None,
        faults: Sequence[Fault] = (),
        physics: WorldSettings | None = None,
        sensor: Sensor = MATCH_SENSOR,
        keeps_figures: bool = True,
        referee: RefereeFactory | None = None,
        disturbances: Disturbances | None = None,
    ) -> None:
        self.arena = Arena(
            field,
            players,
            seed,
            camera=camera,
            robot=robot,
            limits=limits,
            faults=faults,
            physics=physics,
            sensor=sensor,
            referee=referee,
            disturbances=disturbances,
        )
        self.seed = seed
        self._keeps_figures = keeps_figures
        self._log = MatchLog(self.arena.state, self.arena.limits, field.ball_radius_m, faults)
        self._seats = [
            Seat(ours if robot.side > 0 else theirs, self.arena.setup(robot.index)) for robot in self.arena.state.robots
        ]

    def step(self) -> Moment:
        """Play one control period."""
        sensed = self.arena.senses()
        state = self.arena.state
        robots = tuple(seat.act(senses) for seat, senses in zip(self._seats, sensed, strict=True))
        moment = Moment(state, robots)
        after = self.arena.step({index: robot.command for index, robot in enumerate(robots)})
        if self._keeps_figures:
            self._log.add(state, robots)
            self._log.add_events(after)
        return moment

    def play(self, seconds: float) -> Iterator[Moment]:
        """Play on for a time, and yield the moment of each control period."""
        for _ in range(periods(seconds)):
            yield self.step()

    @property
    def figures(self) -> MatchFigures:
        """The figures so far, if they are kept."""
        return self._log.figures


def periods(seconds: float) -> int:
    """Return the number of control periods that cover a time."""
    return math.ceil(seconds / CONTROL_PERIOD_S - 1e-6)
