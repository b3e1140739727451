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

    #: squared Mahalanobis distance of a measurement that agrees with a mode: chi-square with 3 degrees of freedom, 99.9
    #: %
    gate: float = 16.27
    #: up to this many gates a measurement may be less exact than its covariance; this fraction of them is. It then
    #: counts for less.
    near_miss: float = 9.0
    near_miss_rate: float = 0.1
    #: squared Mahalanobis distance below which two modes are merged: nearer than a standard deviation they are one
    merge_distance: float = 1.0
    min_probability: float = 1e-4  #: a mode of a smaller probability is not followed
    max_modes: int = 8  #: modes that are followed at most: bounds the time of an update
    #: largest odds of a field half. However many frames agree, somebody may have turned the robot round.
    max_half_odds: float = 9999.0
    #: odds that the robot is in the half of the pose that `expect` names: it stands there in 4 of 5 cases
    expected_odds: float = 4.0
    #: standard deviations of the velocity of a shove or of spinning wheels
    shove_mps: float = 0.5
    shove_rps: float = 3.0
    #: odometry that is faster is no motion: counters that overflow, a message lost. The defaults are beyond every
    #: league's robots. Nothing is moved by it; modes widen by what the robot may have done, three standard deviations
    #: of which are these.
    max_speed_mps: float = 6.0
    max_turn_rps: float = 30.0
    jitter_s: float = 0.02  #: odometry and its time may be so far apart
    #: a mode whose position has a larger standard deviation is deleted: it is no position any more
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
        """Return whether a robot can move so far in this time."""
        max_s = seconds + self.jitter_s
        if math.hypot(odometry.x_m, odometry.y_m) > self.max_speed_mps * max_s:
            return False
        return abs(odometry.theta_rad) <= self.max_turn_rps * max_s
