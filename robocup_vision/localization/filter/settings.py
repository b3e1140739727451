"""Settings of the pose filter: which measurements agree, which modes are followed, and how far back it remembers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from field_models.errors import ArgumentError
from robocup_vision.geometry import Pose2

# where a robot is known to begin: in its own half, x < 0
Half = Literal["own"]


@dataclass(frozen=True, slots=True)
class PoseFilterSettings:
    """How `PoseFilter` weighs and follows its modes. Errors of odometry and frames: `OdometryNoise`, `FrameErrors`.

    Raises
    ------
    ArgumentError
        A value is out of its range.
    """

    #: squared Mahalanobis distance of a measurement that agrees with a mode: 99.9 % of chi-square with 3 dimensions
    gate: float = 16.27
    #: a measurement up to this many gates away may be less exact than its covariance, as this fraction of them is: it
    #: then counts less
    near_miss: float = 9.0
    near_miss_rate: float = 0.1
    #: squared Mahalanobis distance below which two modes are merged: nearer than a standard deviation they are one
    merge_distance: float = 1.0
    min_probability: float = 1e-4  #: a mode of a smaller probability is not followed
    max_modes: int = 8  #: greatest number of modes: bounds the time of an update
    #: largest odds of a field half. However many frames agree, somebody may have turned the robot round.
    max_half_odds: float = 9999.0
    #: odds that the robot is in the half of the pose that `expect` names
    expected_odds: float = 4.0
    #: standard deviations of the velocity of a shove or of spinning wheels
    shove_mps: float = 0.5
    shove_rps: float = 3.0
    #: odometry that is faster is no motion: counters that overflow, a message lost. The defaults exceed the
    #: speeds of every league's robots. Such odometry moves no mode; modes widen by a motion of which these speeds are
    #: three standard deviations.
    max_speed_mps: float = 6.0
    max_turn_rps: float = 30.0
    jitter_s: float = 0.02  #: greatest delay between odometry and its time
    #: a mode whose position has a larger standard deviation is deleted
    lost_std_m: float = 0.5
    min_frame_s: float = 1e-3  #: frames closer together than this count as taken at the same time
    history_s: float = 1.0  #: a frame that is later than this is not used
    min_candidate_probability: float = 0.1  #: a hypothesis of a smaller probability is no candidate of the estimate

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
        """Return whether a robot can move this far in this time."""
        max_s = seconds + self.jitter_s
        if math.hypot(odometry.x_m, odometry.y_m) > self.max_speed_mps * max_s:
            return False
        return abs(odometry.theta_rad) <= self.max_turn_rps * max_s
