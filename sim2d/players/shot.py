"""Shots of a player that holds the ball, by the shot planner. Field frame."""

from __future__ import annotations

import math

import numpy as np

from field_models.field import Field
from robocup_vision.belief import MapPicture
from robocup_vision.geometry import Pose2
from robocup_vision.mapping.occupancy import FREE
from robocup_vision.planning import Disc, MotionLimits, ShotPlan, ShotPlanner
from sim2d.players.driving.motion import MotionSettings
from sim2d.players.plan import Surroundings
from sim2d.players.tactics.ball_holder import REACTION_S
from sim2d.players.tactics.team_field import KEEPER_LINE_RADII
from sim2d.robot_link import CONTROL_PERIOD_S, RobotLimits

# Standard deviation of a kick's direction relative to the heading.
_KICK_STD_RAD = 0.03
# Ratio of a rolling ball's speed to the kick's: 5/7 for a solid sphere.
_ROLLING_SPEED = 5 / 7
# Mean time for which a ball is held if an opponent can reach it, and if none can.
_LOST_S = 0.5
_SLIPS_S = 8.0
# Standard deviation of the position assumed for an unseen keeper.
_KEEPER_STD_M = 0.1


class Shooter:
    """Plans the shots of one player.

    Parameters
    ----------
    attacks : int
        +1: the goal at +x of the field frame; -1: that at -x.
    motion : MotionSettings
        Speeds of a robot with the ball.
    """

    def __init__(
        self,
        field: Field,
        limits: RobotLimits,
        attacks: int,
        *,
        motion: MotionSettings = MotionSettings(),
    ) -> None:
        self._limits = limits
        self._reach_m = limits.radius_m + field.ball_radius_m
        line, half = attacks * field.length_m / 2, attacks * field.goals[0].width_m / 2
        self._line_m, self._half_m = line, abs(half)
        self._keeper_x_m = line - attacks * KEEPER_LINE_RADII * limits.radius_m
        self.shots = ShotPlanner(
            ((line, half), (line, -half)),
            field.ball_radius_m,
            _ROLLING_SPEED * limits.kick_speed_mps,
            _KICK_STD_RAD,
            MotionLimits(limits.speed_mps, limits.acceleration_mps2, REACTION_S),
            motion.holding_mps,
            motion.holding_rps,
            _LOST_S,
            _SLIPS_S,
        )

    def plan(self, surroundings: Surroundings, turn_rps: float) -> ShotPlan:
        """Plan the use of the ball in the mouth; `turn_rps`: the robot's present turning rate."""
        robot = surroundings.robot.pose
        mouth = robot.compose(Pose2(self._reach_m, 0.0, 0.0))
        # when the command takes effect, the robot has turned further, and the ball also has the robot's velocity
        heading = robot.theta_rad + turn_rps * (self._limits.dead_time_s + CONTROL_PERIOD_S / 2)
        v_x, v_y = surroundings.velocity_mps
        kick = self._limits.kick_speed_mps
        leaves = math.atan2(v_y + kick * math.sin(heading), v_x + kick * math.cos(heading))
        std_x, std_y, heading_std = surroundings.robot.std.tolist()
        return self.shots.plan(
            (mouth.x_m, mouth.y_m), leaves, self._defenders(surroundings), max(std_x, std_y), heading_std
        )

    def _defenders(self, surroundings: Surroundings) -> list[Disc]:
        """Return tracked robots of both sides, and an assumed keeper unless the goal's mouth is known to be empty."""
        t, radius_m = surroundings.age_s, self._limits.radius_m
        known = [
            Disc(*one.place_after(t), radius_m, one.covariance[:2, :2], vx_mps=one.vx_mps, vy_mps=one.vy_mps)
            for one in surroundings.tracks
        ]
        is_kept = any(self._keeps(one.x_m, one.y_m) for one in known)
        if is_kept or self._is_empty(surroundings.floor):
            return known
        return [*known, Disc(self._keeper_x_m, 0.0, radius_m, np.eye(2) * _KEEPER_STD_M**2)]

    def _keeps(self, x_m: float, y_m: float) -> bool:
        radius_m = self._limits.radius_m
        return abs(x_m - self._line_m) < 2 * KEEPER_LINE_RADII * radius_m and abs(y_m) < self._half_m + radius_m

    def _is_empty(self, floor: MapPicture | None) -> bool:
        """Whether all floor on which a keeper would stand is known to be free."""
        if floor is None:
            return False
        y = np.arange(-self._half_m, self._half_m, floor.cell_m)
        corner_x_m, corner_y_m = floor.corner_m
        i, j = (np.floor(way / floor.cell_m).astype(int) for way in (self._keeper_x_m - corner_x_m, y - corner_y_m))
        inside = (i >= 0) & (i < floor.state.shape[0]) & (j >= 0) & (j < floor.state.shape[1])
        return bool(inside.all()) and bool((floor.state[i, j] == FREE).all())
