"""When a player that holds the ball kicks it, and where: what the shot planner makes of its belief. Field frame."""

from __future__ import annotations

import math

import numpy as np

from field_models.field import Field
from robocup_vision.planning import Defender, Disc, MotionLimits, ShotPlan, ShotPlanner
from sim2d.player_motion import HOLDING_MPS, HOLDING_RPS, PERIOD_S
from sim2d.player_planning import Surroundings
from sim2d.robot_link import RobotLimits

# how far a kicked ball leaves the heading, and what of a kick's speed is left when it rolls (a solid sphere)
_KICK_STD_RAD, _ROLLING_SHARE = 0.03, 5 / 7
# others run for a ball so long after the kick; a ball is held for so long on average
_SEEN_S, _LOST_S = 0.15, 2.0


class Shooter:
    """Plans the shots of one player.

    Parameters
    ----------
    field : Field
        The pitch, with goals.
    limits : RobotLimits
        Of all robots on it.
    attacks : int
        +1: the goal at +x of the field frame; -1: that at -x.
    """

    def __init__(self, field: Field, limits: RobotLimits, attacks: int) -> None:
        self._limits = limits
        self._reach_m = limits.radius_m + field.ball_radius_m
        line, half = attacks * field.length_m / 2, attacks * field.goals[0].width_m / 2
        self._planner = ShotPlanner(
            ((line, half), (line, -half)),
            field.ball_radius_m,
            _ROLLING_SHARE * limits.kick_speed_mps,
            _KICK_STD_RAD,
            MotionLimits(limits.speed_mps, limits.acceleration_mps2, _SEEN_S),
            HOLDING_MPS,
            HOLDING_RPS,
            _LOST_S,
        )

    def plan(self, around: Surroundings, turn_rps: float) -> ShotPlan:
        """Plan what to do with the ball in the mouth; `turn_rps`: how fast the robot turns now."""
        robot = around.robot.pose
        ball = robot.array[:2] + self._reach_m * np.array([math.cos(robot.theta_rad), math.sin(robot.theta_rad)])
        # by the time the command works, the robot has turned on, and the ball has its velocity too
        heading = robot.theta_rad + turn_rps * (self._limits.dead_time_s + PERIOD_S / 2)
        v_x, v_y = around.velocity_mps
        kick = self._limits.kick_speed_mps
        leaves = math.atan2(v_y + kick * math.sin(heading), v_x + kick * math.cos(heading))
        std_x, std_y, heading_std = around.robot.std.tolist()
        place = float(ball[0]), float(ball[1])
        return self._planner.plan(place, leaves, self._defenders(around), max(std_x, std_y), heading_std)

    def _defenders(self, around: Surroundings) -> list[Defender]:
        """Whoever moves on the field: it is not known which of them are of the own side."""
        t = around.age_s
        return [
            Defender(
                Disc(one.x_m + t * one.vx_mps, one.y_m + t * one.vy_mps, self._limits.radius_m, one.covariance[:2, :2]),
                one.vx_mps,
                one.vy_mps,
            )
            for one in around.tracks
        ]
