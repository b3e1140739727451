"""What a robot of the league is told: commands that keep what the next one leaves out, for a tenth of a second.

A robot that has had no command for so long brakes until it stands.
"""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.ssl.values.simulation import MoveCommand, RobotCommand, WheelVelocities
from sim2d.world.robot_body import Order, RobotBody
from sim2d.world.robot_spec import RobotSpec

COMMAND_LASTS_S = 0.1
_STAND = Order()


class HeldOrders:
    """The last commands of one robot."""

    def __init__(self, spec: RobotSpec) -> None:
        self._spec = spec
        self._obeys_until_s = -math.inf
        self._held = _STAND
        self._turns_along = False

    def obey(self, command: RobotCommand, t_s: float) -> None:
        """Take a command at a time; what it leaves out stays as it was."""
        # old values must not come back with a later command that leaves them out
        held = _STAND if t_s > self._obeys_until_s else self._held
        velocity = held[:3]
        if command.move is not None:
            self._turns_along, velocity = command.move.world is None, self._velocity(command.move)
        self._held = Order(
            *velocity,
            held.kick_mps if command.kick_mps is None else command.kick_mps,
            held.kick_rise_rad
            if command.kick_angle_rad is None
            else min(max(command.kick_angle_rad, 0.0), math.pi / 2),
            held.dribbles if command.dribbler_rps is None else command.dribbler_rps > 0,
        )
        self._obeys_until_s = t_s + COMMAND_LASTS_S

    def _velocity(self, move: MoveCommand) -> tuple[float, float, float]:
        """Return what a command wants: over the carpet, or forward and left, and the turn."""
        if move.world is not None:
            return move.world.x_mps, move.world.y_mps, move.world.turn_rps
        if move.local is not None:
            return move.local.forward_mps, move.local.left_mps, move.local.turn_rps
        return (0.0, 0.0, 0.0) if move.wheels is None else body_velocity(self._spec, move.wheels)

    def at(self, t_s: float, robot: RobotBody) -> Order:
        """Return the order over the carpet at a time."""
        if t_s > self._obeys_until_s:
            return _STAND
        if not self._turns_along:
            return self._held
        x, y = self._held[:2]
        c, s = math.cos(robot.body.angle), math.sin(robot.body.angle)
        return self._held._replace(x_mps=c * x - s * y, y_mps=s * x + c * y)


def body_velocity(spec: RobotSpec, wheels: WheelVelocities) -> tuple[float, float, float]:
    """Return forward, left and turning velocity that fit the wheels' rim speeds best (least squares)."""
    rims = wheels.front_right_mps, wheels.back_right_mps, wheels.back_left_mps, wheels.front_left_mps
    matrix = [[-math.sin(angle), math.cos(angle), spec.radius_m] for angle in spec.wheel_angles_rad]
    forward, left, turn = np.linalg.lstsq(np.array(matrix), np.array(rims), rcond=None)[0].tolist()
    return forward, left, turn
