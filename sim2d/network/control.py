"""Executes a SimulatorCommand: moves ball and robots, changes robots, field and realism.

A part of the command that cannot be executed gives an error with a code; the other parts are executed.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from typing import Any, Protocol

import numpy as np

from field_models.errors import ArgumentError, PacketError
from field_models.field import Field
from robocup_vision.geometry import Pose2
from robocup_vision.ssl.field import field_from_geometry
from robocup_vision.ssl.protocol.mapping import decode
from robocup_vision.ssl.values.geometry import Geometry
from robocup_vision.ssl.values.simulation import (
    AnyMessage,
    ErForceRealism,
    ErForceRobotSpec,
    RobotId,
    RobotSpecs,
    SimulatorCommand,
    SimulatorError,
    Team,
    TeleportBall,
    TeleportRobot,
)
from sim2d.network.realism import UNSUPPORTED, Realism, changed_realism
from sim2d.network.world import MAX_NUMBER, LeagueWorld
from sim2d.world.ball_physics import Flight
from sim2d.world.robot_spec import RobotSpec
from sim2d.world.state import BallState

# bounds of places, velocities and the field's size: far beyond the league's, but finite
MAX_PLACE_M, MAX_SPEED_MPS, MAX_TURN_RPS, MAX_HEIGHT_M = 20.0, 30.0, 100.0, 20.0
MAX_FIELD_M, MAX_LINES = 30.0, 100
# bounds of simulated time per real time: at a lower speed a program would wait minutes for the next step
MIN_CLOCK_RATIO, MAX_CLOCK_RATIO = 0.01, 100.0
# each key of a robot's specification: its smallest and largest value
_SPEC_RANGES = {
    "radius_m": (0.02, 0.3),
    "height_m": (0.02, 1.0),
    "mass_kg": (0.1, 50.0),
    "max_kick_mps": (0.0, 30.0),
    "max_chip_mps": (0.0, 30.0),
    "center_to_dribbler_m": (0.01, 0.3),
    "dribbler_width_m": (0.01, 0.3),
    "speed_up_mps2": (0.01, 1000.0),
    "brake_mps2": (0.01, 1000.0),
    "turn_speed_up_rps2": (0.01, 10000.0),
    "turn_brake_rps2": (0.01, 10000.0),
    "max_speed_mps": (0.0, MAX_SPEED_MPS),
    "max_turn_rps": (0.0, MAX_TURN_RPS),
}


class Controlled(Protocol):
    """The simulator's state that commands change; see `sim2d.network.league.LeagueSimulator`."""

    world: LeagueWorld
    speed: float
    vision_port: int

    @property
    def realism(self) -> Realism:
        """The noise, delays and losses that are simulated now."""
        ...

    def set_realism(self, realism: Realism) -> None:
        """Change the simulated noise, delays and losses."""
        ...

    def set_field(self, field: Field, flight: Flight) -> None:
        """Replace the field and the parameters of the ball's flight."""
        ...


class _Refused(Exception):
    """A part of a command is refused: an error code and messages."""

    def __init__(self, code: str, *messages: str) -> None:
        super().__init__(code)
        self.errors = [SimulatorError(code, message) for message in messages]


def apply_command(simulator: Controlled, command: SimulatorCommand) -> list[SimulatorError]:
    """Execute a command; return the parts that were not executed."""
    errors: list[SimulatorError] = []
    for execute, part in _parts(command):
        try:
            if part is not None:
                execute(simulator, part)
        except _Refused as refused:
            errors += refused.errors
    return errors


def _parts(command: SimulatorCommand) -> Iterator[tuple[Callable[[Controlled, Any], None], Any]]:
    """Yield each part of a command after the function that executes it."""
    config, control = command.config, command.control
    # settings first, since places refer to the new field
    if config is not None:
        yield _set_geometry, config.geometry
        yield from ((_set_spec, specs) for specs in config.robot_specs)
        if config.realism is not None:
            yield from ((_set_realism, custom) for custom in config.realism.custom)
        yield _set_vision_port, config.vision_port
    if control is not None:
        yield from ((_teleport_robot, robot) for robot in control.robots)
        yield _teleport_ball, control.ball
        yield _set_speed, control.speed


def _set_speed(simulator: Controlled, speed: float) -> None:
    if speed != 0 and not MIN_CLOCK_RATIO <= speed <= MAX_CLOCK_RATIO:
        limits = f"0 or from {MIN_CLOCK_RATIO:g} to {MAX_CLOCK_RATIO:g}"
        raise _Refused("SPEED_RANGE", f"simulation_speed must be {limits}, got {speed}")
    simulator.speed = speed


def _set_vision_port(simulator: Controlled, port: int) -> None:
    if not 1 <= port <= 65535:
        raise _Refused("VISION_PORT", f"there is no port {port}")
    simulator.vision_port = port


def _teleport_ball(simulator: Controlled, ball: TeleportBall) -> None:
    if ball.by_force:
        raise _Refused("BY_FORCE", "the ball cannot be moved by force; leave by_force out to teleport it")
    now = simulator.world.ball
    state = BallState(
        _checked("x", ball.x_m, MAX_PLACE_M, now.x_m),
        _checked("y", ball.y_m, MAX_PLACE_M, now.y_m),
        _checked("vx", ball.vx_mps, MAX_SPEED_MPS, now.vx_mps),
        _checked("vy", ball.vy_mps, MAX_SPEED_MPS, now.vy_mps),
        _checked("z", ball.z_m, MAX_HEIGHT_M, now.z_m),
        _checked("vz", ball.vz_mps, MAX_SPEED_MPS, now.vz_mps),
    )
    if state.z_m < 0:
        raise _Refused("TELEPORT_RANGE", f"z must not be below the floor, got {state.z_m}")
    simulator.world.place_ball(state, rolls=bool(ball.roll))
    if ball.teleport_safely:
        simulator.world.make_room(state.x_m, state.y_m)


def _teleport_robot(simulator: Controlled, robot: TeleportRobot) -> None:
    team, number = _robot_key(robot.robot)
    name = f"robot {number} of {team.name.lower()}"
    world = simulator.world
    if robot.by_force:
        raise _Refused("BY_FORCE", f"{name} cannot be moved by force; leave by_force out to teleport it")
    is_there = world.has(team, number)
    now = world.robot(team, number).pose if is_there else Pose2(0.0, 0.0, 0.0)
    pose = Pose2(
        _checked("x", robot.x_m, MAX_PLACE_M, now.x_m),
        _checked("y", robot.y_m, MAX_PLACE_M, now.y_m),
        _checked("orientation", robot.orientation_rad, 1000.0, now.theta_rad),
    )
    velocity = (
        _checked("v_x", robot.vx_mps, MAX_SPEED_MPS, 0.0),
        _checked("v_y", robot.vy_mps, MAX_SPEED_MPS, 0.0),
    )
    turn = _checked("v_angular", robot.turn_rps, MAX_TURN_RPS, 0.0)
    if robot.present is False:
        if is_there:
            world.remove(team, number)
        return
    if not is_there:
        if not robot.present:
            raise _Refused("ROBOT_NOT_PRESENT", f"{name} is not on the field; set present to put it there")
        world.add(team, number, pose)
    elif robot == TeleportRobot(robot.robot, present=robot.present, by_force=robot.by_force, unknown=robot.unknown):
        # the message has neither a pose nor a velocity
        return
    world.place(team, number, pose, velocity, turn)


def _robot_key(robot: RobotId) -> tuple[Team, int]:
    if robot.team not in (Team.YELLOW, Team.BLUE):
        raise _Refused("UNKNOWN_TEAM", f"a robot's team must be yellow (1) or blue (2), got {robot.team!r}")
    if robot.number is None or robot.number > MAX_NUMBER:
        raise _Refused("UNKNOWN_ROBOT", f"a robot's id must be from 0 to {MAX_NUMBER}, got {robot.number}")
    return robot.team, robot.number


def _checked(key: str, value: float | None, largest: float, kept: float) -> float:
    """Return a value after a check of its size; if it is omitted, return the present value `kept`."""
    if value is None:
        return kept
    if not abs(value) <= largest:
        raise _Refused("TELEPORT_RANGE", f"{key} must be within {largest:g}, got {value}")
    return value


def _set_geometry(simulator: Controlled, geometry: Geometry) -> None:
    if max(len(geometry.field.lines), len(geometry.field.arcs)) > MAX_LINES:
        raise _Refused("GEOMETRY", f"a field must have at most {MAX_LINES} lines and arcs")
    try:
        field = field_from_geometry(geometry)
    except PacketError as error:
        raise _Refused("GEOMETRY", str(error)) from None
    reach_m = float(2 * np.abs(field.floor_polygon).max())
    if not reach_m <= MAX_FIELD_M or not 0.01 <= field.ball_radius_m <= 0.2 or field.robot_radius_m > 0.3:
        raise _Refused("GEOMETRY", f"a field must be at most {MAX_FIELD_M:g} m long and wide, got {reach_m:g}")
    flight = simulator.world.flight
    bouncing = None if geometry.models is None else geometry.models.bouncing
    if bouncing is not None:
        ratios = (bouncing.first_floor_ratio, bouncing.later_floor_ratio, bouncing.up_ratio)
        if not all(0 <= ratio <= 1 for ratio in ratios) or bouncing.up_ratio > 0.95:
            raise _Refused(
                "GEOMETRY", f"what a bounce keeps must be from 0 to 1 and upwards at most 0.95, got {ratios}"
            )
        flight = Flight(*ratios)
    simulator.set_field(field, flight)


def _set_spec(simulator: Controlled, specs: RobotSpecs) -> None:
    team, number = _robot_key(specs.robot)
    changes: dict[str, object] = {}
    for key in ("radius_m", "height_m", "mass_kg", "max_kick_mps", "max_chip_mps", "center_to_dribbler_m"):
        changes[key] = getattr(specs, key)
    if specs.limits is not None:
        limits = specs.limits
        changes |= {"speed_up_mps2": limits.speed_up_mps2, "brake_mps2": limits.brake_mps2}
        changes |= {"turn_speed_up_rps2": limits.turn_speed_up_rps2, "turn_brake_rps2": limits.turn_brake_rps2}
        changes |= {"max_speed_mps": limits.speed_mps, "max_turn_rps": limits.turn_rps}
    for custom in specs.custom:
        if custom.kind != "RobotSpecErForce":
            raise _Refused("SPEC_UNKNOWN", f"there is no robot specification {custom.kind!r} here")
        try:
            more = decode(ErForceRobotSpec, custom.value or b"")
        except PacketError as error:
            raise _Refused("SPEC_UNREADABLE", str(error)) from None
        changes["dribbler_width_m"] = more.dribbler_width_m
        if more.shoot_radius_m is not None and changes.get("center_to_dribbler_m") is None:
            changes["center_to_dribbler_m"] = more.shoot_radius_m
    changes = {key: value for key, value in changes.items() if value is not None}
    for key, value in changes.items():
        low, high = _SPEC_RANGES[key]
        if not (isinstance(value, float) and low <= value <= high):
            raise _Refused("SPEC_RANGE", f"a robot's {key} must be from {low:g} to {high:g}, got {value}")
    if specs.wheel_angles is not None:
        wheels = specs.wheel_angles
        angles = (wheels.front_right_rad, wheels.back_right_rad, wheels.back_left_rad, wheels.front_left_rad)
        if not all(map(math.isfinite, angles)):
            raise _Refused("SPEC_RANGE", f"a robot's wheel angles must be finite, got {angles}")
        changes["wheel_angles_rad"] = angles
    spec: RobotSpec = dataclasses.replace(simulator.world.spec(team, number), **changes)  # type: ignore[arg-type]
    if spec.center_to_dribbler_m > spec.radius_m:
        raise _Refused("SPEC_RANGE", f"a robot's center_to_dribbler must not exceed its radius, got {spec}")
    simulator.world.set_spec(team, number, spec)


def _set_realism(simulator: Controlled, custom: AnyMessage) -> None:
    if custom.kind != "RealismConfigErForce":
        raise _Refused("REALISM_UNKNOWN", f"there is no realism configuration {custom.kind!r} here")
    try:
        message = decode(ErForceRealism, custom.value or b"")
        simulator.set_realism(changed_realism(simulator.realism, message))
    except (PacketError, ArgumentError) as error:
        raise _Refused("REALISM_RANGE", str(error)) from None
    unsupported = [f"{key} is not simulated" for key in UNSUPPORTED if getattr(message, key) is not None]
    if unsupported:
        raise _Refused("REALISM_UNSUPPORTED", *unsupported)
