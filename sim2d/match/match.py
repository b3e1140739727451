"""Plays a match: in every control period each player gets its robot's senses, and nothing else, and returns a command.

A player that fails is stopped; the match goes on.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from field_models.field import Field
from robocup_vision.camera import Rig
from sim2d.match.arena import Arena
from sim2d.match.disturbances import Disturbances
from sim2d.match.seat import Seat
from sim2d.match.setups import Camera, RobotKind
from sim2d.players.built_in import BuiltInPlayer
from sim2d.rendering.sensor import Sensor
from sim2d.report.match_figures import MatchFigures, MatchLog
from sim2d.report.moment import Moment
from sim2d.robot_link import CONTROL_PERIOD_S, PlayerFactory, RobotLimits
from sim2d.sensors.faults import Fault
from sim2d.sensors.match_camera import MATCH_SENSOR
from sim2d.world.referee import RefereeFactory
from sim2d.world.world import WorldSettings


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
        Count what `figures` tells: each control period takes some memory.

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
        """Play on for so long, yielding each control period."""
        for _ in range(periods(seconds)):
            yield self.step()

    @property
    def figures(self) -> MatchFigures:
        """The figures so far, where they are kept."""
        return self._log.figures


def periods(seconds: float) -> int:
    """Return how many control periods so many seconds are."""
    return math.ceil(seconds / CONTROL_PERIOD_S - 1e-6)
