"""Settings of the pose filter: gates, modes and history."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from field_models.errors import ArgumentError
from robocup_vision.geometry import Pose2

# where a robot is known to start: in its own half, x < 0
Half = Literal["own"]


@dataclass(frozen=True, slots=True)
class PoseFilterSettings:
    """Settings of `PoseFilter`. Errors of odometry and frames: `OdometryNoise`, `FrameErrors`.

    Raises
    ------
    ArgumentError
        A value is out of its range.
    """

    #: gate: squared Mahalanobis distance of a matching measurement, 99.9 % of chi-square with 3 degrees of freedom
    gate: float = 16.27
    #: number of gates up to which a measurement is a near miss, and the ratio of measurements that are less accurate
    #: than their covariance; a near miss has less weight
    near_miss: float = 9.0
    near_miss_rate: float = 0.1
    #: squared Mahalanobis distance below which two modes are merged
    merge_distance: float = 1.0
    min_probability: float = 1e-4  #: probability below which a mode is deleted
    max_modes: int = 8  #: greatest number of modes, which bounds the time of an update
    #: greatest odds of a field half, because the robot may have been turned
    max_half_odds: float = 9999.0
    #: odds that the robot is in the half of the pose named by `expect`
    expected_odds: float = 4.0
    #: standard deviations of the velocity of a shove or of spinning wheels
    shove_mps: float = 0.5
    shove_rps: float = 3.0
    #: greatest speeds of a robot, above those of all leagues. Faster odometry is an error, such as an overflow or a
    #: lost message: it moves no mode, but modes widen as if these speeds were three standard deviations of the motion.
    max_speed_mps: float = 6.0
    max_turn_rps: float = 30.0
    jitter_s: float = 0.02  #: greatest delay between odometry and its time
    #: standard deviation of the position at which a mode is deleted
    lost_std_m: float = 0.5
    min_frame_s: float = 1e-3  #: least time between frames; closer ones count as simultaneous
    history_s: float = 1.0  #: greatest age of a frame that is used
    min_candidate_probability: float = 0.1  #: least probability of a hypothesis that is a candidate of the estimate

    def __post_init__(self) -> None:
        positive = ("gate", "merge_distance", "shove_mps", "shove_rps", "max_speed_mps", "max_turn_rps", "lost_std_m")
        for name in (*positive, "min_frame_s", "history_s"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ArgumentError(f"{name} must be positive, got {getattr(self, name)!r}")
        for name in ("near_miss_rate", "min_probability", "min_candidate_probability"):
            if not 0.0 < getattr(self, name) < 1.0:
                raise ArgumentError(f"{name} must be above 0 and below 1, got {getattr(self, name)!r}")
        if not 0.0 <= self.jitter_s < math.inf:
            raise ArgumentError(f"jitter_s must not be negative, got {self.jitter_s!r}")
        for name in ("near_miss", "max_half_odds", "expected_odds"):
            if not 1.0 <= getattr(self, name) < math.inf:
                raise ArgumentError(f"{name} must be at least 1, got {getattr(self, name)!r}")
        if self.max_modes < 1:
            raise ArgumentError(f"max_modes must be at least 1, got {self.max_modes!r}")

    def is_possible(self, odometry: Pose2, seconds: float) -> bool:
        """Whether a robot can move this far in this time."""
        max_s = seconds + self.jitter_s
        if math.hypot(odometry.x_m, odometry.y_m) > self.max_speed_mps * max_s:
            return False
        return abs(odometry.theta_rad) <= self.max_turn_rps * max_s
