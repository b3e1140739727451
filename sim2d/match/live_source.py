"""Robots of a simulated match as a source of `robocup-vision live`: each robot's own view, and the truth.

Registered as the kind `sim`: ``sim:FIELD[,players=N][,seed=S][,robots=0+1][,ours=NAME][,theirs=NAME]``.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.camera import load_camera
from robocup_vision.geometry import Pose2
from robocup_vision.live.handover.moment import RobotPlan, RobotSetup, TrueRobot, TrueWorld
from robocup_vision.live.sources.source import PlacingSource, SourceFrame, SourceOptions
from robocup_vision.recording.loops import mounting_of
from robocup_vision.view import RigView
from robocup_vision.vision import Vision
from sim2d.match.match import Match
from sim2d.players.catalog import player_factory
from sim2d.world.state import Moment, RobotMoment, WorldState

_KEYS = ("players", "seed", "robots", "ours", "theirs")


def open_match(text: str, options: SourceOptions) -> MatchSource:
    """Begin the match that a source's text describes.

    Parameters
    ----------
    text : str
        A field, then any of the module's options as ``,key=value``.
    options : SourceOptions
        The camera is put on every robot. Players look by themselves, so other options are refused.

    Raises
    ------
    ArgumentError
        If the text or an option does not apply to a match.
    """
    field, *pairs = text.split(",")
    chosen: dict[str, str] = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if key not in _KEYS or not equals or key in chosen:
            raise ArgumentError(f"sim:{text}: {pair!r} must be one of {', '.join(f'{key}=...' for key in _KEYS)}")
        chosen[key] = value
    given = {"--colors": options.colors, "--method": options.method, "--memory": options.memory or None}
    for name in given:
        if given[name] is not None:
            raise ArgumentError(f"sim:{text}: {name} says nothing to simulated robots: they look themselves")
    if options.field is not None and options.field != field:
        raise ArgumentError(f"sim:{text}: is played on its own field, --field says {options.field!r}")
    players = _number(text, chosen, "players", 0) if "players" in chosen else None
    match = Match(
        load_field(field or "ssl_2001"),
        players,
        _number(text, chosen, "seed", 0),
        ours=player_factory(chosen.get("ours", "plain")),
        theirs=player_factory(chosen.get("theirs", "plain")),
        camera=None if options.camera is None else load_camera(options.camera),
        keeps_figures=False,
    )
    return MatchSource(f"sim:{text}", match, _robots(text, chosen.get("robots", "0"), 2 * match.arena.players))


class MatchSource(PlacingSource):
    """A match that goes on for as long as it is read.

    Parameters
    ----------
    robots : sequence of int
        Indices of the robots that are shown.
    """

    waits = True

    def __init__(self, name: str, match: Match, robots: tuple[int, ...]) -> None:
        self.name = name
        self._match, self._robots = match, robots
        arena = match.arena
        self._names = {_name(robot.index): robot.index for robot in arena.state.robots}
        self.setups = tuple(
            RobotSetup(_name(index), arena.field, arena.camera, arena.limits.radius_m) for index in robots
        )

    def make_vision(self, setup: RobotSetup) -> Vision | None:
        """Return None: players look by themselves."""
        return None

    def read(self, timeout_s: float) -> tuple[SourceFrame, ...] | None:
        """Play one control period, and return the frames of the shown robots."""
        moment = self._match.step()
        frames = (self._frame(moment, index) for index in self._robots)
        return tuple(frame for frame in frames if frame is not None)

    def place(self, thing: str, x_m: float, y_m: float, theta_rad: float | None) -> None:
        """Put a robot or the ball elsewhere, at rest; odometry does not measure this motion.

        Raises
        ------
        ArgumentError
            If there is no such thing, the place is off the floor, or the ball is held for a kick-off.
        """
        arena = self._match.arena
        end_x_m, end_y_m = np.abs(arena.field.floor_polygon).max(axis=0)
        if abs(x_m) > end_x_m or abs(y_m) > end_y_m:
            raise ArgumentError(f"{thing} cannot be put at ({x_m:.2f}, {y_m:.2f}): that is off the floor")
        if thing == "ball":
            if arena.state.phase == "kick_off":
                raise ArgumentError("the ball lies at the centre until the whistle of the kick-off")
            arena.world.place_ball(x_m, y_m)
        elif thing in self._names:
            index = self._names[thing]
            heading_rad = arena.state.robots[index].pose.theta_rad if theta_rad is None else theta_rad
            arena.world.place(index, Pose2(x_m, y_m, heading_rad))
        else:
            raise ArgumentError(
                f"there is no {thing!r} in this match, only the ball and robots 0 to {len(self._names) - 1}"
            )

    def _frame(self, moment: Moment, index: int) -> SourceFrame | None:
        robot, truth = moment.robots[index], moment.state.robots[index]
        frame, frame_t_s = robot.senses.frame, robot.senses.frame_t_s
        if frame is None or frame_t_s is None:
            return None
        view = robot.status.view
        if view is not None and view.t_s != frame_t_s:
            # the player has not looked at this frame
            view = None
        # the page shows only the first camera of a rig
        view = view.of_camera(0) if isinstance(view, RigView) else view
        return SourceFrame(
            _name(index),
            frame,
            frame_t_s,
            robot.senses.odometry,
            mounting_of(robot.senses.frame_pan_rad),
            view=view,
            colors=robot.status.colors,
            plan=_plan(robot),
            truth=truth.pose if frame_t_s == moment.state.t_s else None,
            world=_world(moment.state),
        )


def _name(index: int) -> str:
    return f"robot {index}"


def _world(state: WorldState) -> TrueWorld:
    robots = tuple(TrueRobot(_name(robot.index), robot.side, robot.pose) for robot in state.robots)
    return TrueWorld(robots, None if state.ball is None else (state.ball.x_m, state.ball.y_m))


def _plan(robot: RobotMoment) -> RobotPlan:
    status, command = robot.status, robot.command
    reasons = [f"intent: {status.intent}", *(f"{reason.topic}: {reason.text}" for reason in status.reasons)]
    if robot.stopped:
        reasons.append(f"its player was stopped: {robot.stopped}")
    way = () if status.waypoint_in_field is None else (status.waypoint_in_field,)
    return RobotPlan((command.forward_mps, command.left_mps, command.turn_rps), way, tuple(reasons))


def _number(text: str, chosen: Mapping[str, str], key: str, default: int) -> int:
    value = chosen.get(key, str(default))
    if not value.isdecimal():
        raise ArgumentError(f"sim:{text}: {key} must be a whole number, got {value!r}")
    return int(value)


def _robots(text: str, value: str, count: int) -> tuple[int, ...]:
    numbers = value.split("+")
    if not all(number.isdecimal() and int(number) < count for number in numbers) or len(set(numbers)) < len(numbers):
        raise ArgumentError(f"sim:{text}: robots must be numbers from 0 to {count - 1} joined by '+', got {value!r}")
    return tuple(map(int, numbers))
