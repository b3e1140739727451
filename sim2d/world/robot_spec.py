"""Dimensions, limits and imperfections of a robot."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from sim2d.robot_link import RobotLimits


@dataclass(frozen=True, slots=True)
class BodySettings:
    """Mass and imperfections of the robots of a match."""

    #: Mass, by default of a small robot.
    mass_kg: float = 2.5
    #: Standard deviation of the odometry's systematic errors of distance and angle, drawn once per robot.
    gain_std: float = 0.01
    #: Standard deviation of the slip, as a fraction of the speed.
    slip_part: float = 0.05
    #: Standard deviation of the slip in turning, per metre driven.
    slip_turn_rad_per_m: float = 0.05
    #: Time that the kicker needs to charge.
    kick_again_s: float = 0.5
    #: Standard deviation of a kick's speed, as a fraction of it.
    kick_speed_std: float = 0.05
    #: Standard deviation of a kick's direction.
    kick_angle_std_rad: float = math.radians(1.5)


#: Wheels without slip, and a kicker without errors: robots of the league's simulator.
PERFECT = BodySettings(2.5, 0.0, 0.0, 0.0, kick_again_s=0.1, kick_speed_std=0.0, kick_angle_std_rad=0.0)


@dataclass(frozen=True, slots=True)
class RobotSpec:
    """Dimensions and limits of a robot; the defaults are those of a fast robot of division B."""

    #: Radius and height of its hull.
    radius_m: float = 0.09
    height_m: float = 0.15
    mass_kg: float = 2.5
    #: Distance from its centre to its flat front; for a round robot its radius.
    center_to_dribbler_m: float = 0.075
    #: Width of the mouth in that front.
    dribbler_width_m: float = 0.07
    #: Largest speeds of the ball after a straight kick and a chip.
    max_kick_mps: float = 8.0
    max_chip_mps: float = 8.0
    #: Largest accelerations, in any direction.
    speed_up_mps2: float = 4.0
    brake_mps2: float = 6.0
    turn_speed_up_rps2: float = 50.0
    turn_brake_rps2: float = 50.0
    #: Largest velocities, in any direction.
    max_speed_mps: float = 4.0
    max_turn_rps: float = 20.0
    #: Places of the front right, back right, back left and front left wheel, counter-clockwise from straight ahead; a
    #: positive wheel speed drives counter-clockwise about the robot's centre.
    wheel_angles_rad: tuple[float, float, float, float] = (
        math.radians(-60),
        math.radians(-135),
        math.radians(135),
        math.radians(60),
    )
    #: Whether its velocity rotates with it, as with gripping wheels, and is added to that of a kick. Otherwise ordered
    #: velocities and those of kicks are relative to the carpet.
    turns_along: bool = False
    #: Time from an order until wheels and neck obey it.
    dead_time_s: float = 0.0
    #: Speed of the head's pan, and its limit to either side.
    pan_rps: float = 0.0
    pan_limit_rad: float = 0.0

    @classmethod
    def of(cls, limits: RobotLimits, body: BodySettings, ball_radius_m: float) -> RobotSpec:
        """Return a round robot of a match, whose mouth is 1.5 times as wide as the ball."""
        return cls(
            radius_m=limits.radius_m,
            height_m=limits.height_m,
            mass_kg=body.mass_kg,
            center_to_dribbler_m=limits.radius_m,
            dribbler_width_m=3 * ball_radius_m,
            turns_along=True,
            dead_time_s=limits.dead_time_s,
            pan_rps=limits.pan_rps,
            pan_limit_rad=limits.pan_limit_rad,
        ).limited(limits)

    def limited(self, limits: RobotLimits) -> RobotSpec:
        """Return the same robot with the speeds, accelerations and kicks of `limits`."""
        return replace(
            self,
            max_kick_mps=limits.kick_speed_mps,
            speed_up_mps2=limits.acceleration_mps2,
            brake_mps2=limits.acceleration_mps2,
            turn_speed_up_rps2=limits.turn_acceleration_rps2,
            turn_brake_rps2=limits.turn_acceleration_rps2,
            max_speed_mps=limits.speed_mps,
            max_turn_rps=limits.turn_rps,
        )
