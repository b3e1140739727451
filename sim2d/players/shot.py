"""When a player that holds the ball kicks it, and where: what the shot planner makes of its belief. Field frame."""

from __future__ import annotations

import math

import numpy as np

from field_models.field import Field
from robocup_vision.belief import MapPicture
from robocup_vision.geometry import Pose2
from robocup_vision.mapping.occupancy import FREE
from robocup_vision.planning import Defender, Disc, MotionLimits, ShotPlan, ShotPlanner
from sim2d.players.motion import HOLDING_MPS, HOLDING_RPS, PERIOD_S
from sim2d.players.tactics import KEEPER_RADII
from sim2d.players.travel import Surroundings
from sim2d.robot_link import RobotLimits

# how far a kicked ball leaves the heading, and what of a kick's speed is left when it rolls (a solid sphere)
_KICK_STD_RAD, _ROLLING_SHARE = 0.03, 5 / 7
# others run for a ball so long after the kick; a ball that they reach is held for so long, any other for so long
_SEEN_S, _LOST_S, _SLIPS_S = 0.3, 0.5, 8.0
# how well it is known where a keeper stands
_KEEPER_STD_M = 0.1


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

    Attributes
    ----------
    shots : ShotPlanner
        Knows the goal, the ball and what robots can do.
    """

    def __init__(self, field: Field, limits: RobotLimits, attacks: int) -> None:
        self._limits = limits
        self._reach_m = limits.radius_m + field.ball_radius_m
        line, half = attacks * field.length_m / 2, attacks * field.goals[0].width_m / 2
        self._line_m, self._half_m = line, abs(half)
        self._keeper_x_m = line - attacks * KEEPER_RADII * limits.radius_m
        self.shots = ShotPlanner(
            ((line, half), (line, -half)),
            field.ball_radius_m,
            _ROLLING_SHARE * limits.kick_speed_mps,
            _KICK_STD_RAD,
            MotionLimits(limits.speed_mps, limits.acceleration_mps2, _SEEN_S),
            HOLDING_MPS,
            HOLDING_RPS,
            _LOST_S,
            _SLIPS_S,
        )

    def plan(self, around: Surroundings, turn_rps: float) -> ShotPlan:
        """Plan what to do with the ball in the mouth; `turn_rps`: how fast the robot turns now."""
        robot = around.robot.pose
        mouth = robot.compose(Pose2(self._reach_m, 0.0, 0.0))
        # by the time the command works, the robot has turned on, and the ball has its velocity too
        heading = robot.theta_rad + turn_rps * (self._limits.dead_time_s + PERIOD_S / 2)
        v_x, v_y = around.velocity_mps
        kick = self._limits.kick_speed_mps
        leaves = math.atan2(v_y + kick * math.sin(heading), v_x + kick * math.cos(heading))
        std_x, std_y, heading_std = around.robot.std.tolist()
        return self.shots.plan((mouth.x_m, mouth.y_m), leaves, self._defenders(around), max(std_x, std_y), heading_std)

    def _defenders(self, around: Surroundings) -> list[Defender]:
        """Whoever moves on the field, of either side, and a keeper, unless the goal's mouth is seen empty."""
        t, radius_m = around.age_s, self._limits.radius_m
        known = [
            Defender(Disc(*one.place_after(t), radius_m, one.covariance[:2, :2]), one.vx_mps, one.vy_mps)
            for one in around.tracks
        ]
        is_kept = any(self._keeps(one.disc.x_m, one.disc.y_m) for one in known)
        if is_kept or self._is_empty(around.floor):
            return known
        return [*known, Defender(Disc(self._keeper_x_m, 0.0, radius_m, np.eye(2) * _KEEPER_STD_M**2))]

    def _keeps(self, x_m: float, y_m: float) -> bool:
        radius_m = self._limits.radius_m
        return abs(x_m - self._line_m) < 2 * KEEPER_RADII * radius_m and abs(y_m) < self._half_m + radius_m

    def _is_empty(self, floor: MapPicture | None) -> bool:
        """Whether all floor where a keeper would stand is known to be free."""
        if floor is None:
            return False
        y = np.arange(-self._half_m, self._half_m, floor.cell_m)
        corner_x_m, corner_y_m = floor.corner_m
        i, j = (np.floor(way / floor.cell_m).astype(int) for way in (self._keeper_x_m - corner_x_m, y - corner_y_m))
        inside = (i >= 0) & (i < floor.state.shape[0]) & (j >= 0) & (j < floor.state.shape[1])
        return bool(inside.all()) and bool((floor.state[i, j] == FREE).all())
