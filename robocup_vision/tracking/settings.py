"""Settings of the tracking of moving objects: how they move, how they are detected, and when one is reported."""

from __future__ import annotations

import math
from dataclasses import dataclass

from field_models.errors import ArgumentError


@dataclass(frozen=True, slots=True)
class MovingObjectsSettings:
    """How `MovingObjects` follows what moves.

    Parameters
    ----------
    acceleration_mps2 : float
        How hard the objects accelerate: standard deviation of the white acceleration that the filters allow.
    speed_mps : float
        How fast they may be at first sight: standard deviation.
    steady_s : float
        Time constant with which the velocity of an object without detections decays: it stops or turns sooner or later.
    lifetime_s : float
        Mean time for which an object stays on the field.
    detection_probability : float
        Fraction of the frames in which an object is detected that nothing hides.
    clutter_per_m2 : float
        False detections a frame and square metre.
    width_m : float
        Of the objects: what they hide, and the distance within which several detections belong to one object.
    gate : float
        Squared Mahalanobis distance of a detection that may still belong to a branch: chi-square with 2 degrees of
        freedom, 99.9 %.
    first_log_odds : float
        Log-odds that a detection which no track explains is a new object.
    confirmed_log_odds, deleted_log_odds : float
        From the first on an object is reported; below the second it is deleted. Two bounds, so that a track does not
        come and go.
    min_frames : int
        An object is reported after this many detections at the earliest.
    coast_s : float
        An object without a detection for longer than this is deleted.
    near_ratio : float
        A reported position is right within this fraction of the object's width: half of what a robot would touch.
    unknown_ratio : float
        Fraction of the covariance that a missed detection leaves at least: nine points cannot show less.
    history_frames : int
        Frames after which a choice between branches is final, and over which equal branches are one.
    max_log_ratio : float
        A branch that is less likely than its tree's best by more than this log-likelihood ratio is deleted.
    max_branches : int
        Branches kept of each object's tree.
    max_steps : int
        Steps of the joint choice of branches, after which the best choice so far is taken: bounds its time.

    Raises
    ------
    ArgumentError
        If one of them is out of range.
    """

    acceleration_mps2: float = 1.5
    speed_mps: float = 0.7
    steady_s: float = 1.5
    lifetime_s: float = 100.0
    detection_probability: float = 0.8
    clutter_per_m2: float = 0.2
    width_m: float = 0.18
    gate: float = 13.8
    first_log_odds: float = -3.0
    confirmed_log_odds: float = 4.0
    deleted_log_odds: float = -3.0
    min_frames: int = 3
    coast_s: float = 3.0
    near_ratio: float = 2 / 3
    unknown_ratio: float = 0.05
    history_frames: int = 5
    max_log_ratio: float = 7.0
    max_branches: int = 12
    max_steps: int = 1000

    def __post_init__(self) -> None:
        for name in (
            "acceleration_mps2", "speed_mps", "steady_s", "lifetime_s", "clutter_per_m2", "width_m", "gate", "coast_s",
            "near_ratio", "max_log_ratio",
        ):  # fmt: skip
            if not 0 < getattr(self, name) < math.inf:
                raise ArgumentError(f"{name} must be positive, got {getattr(self, name)}")
        for name in ("min_frames", "history_frames", "max_branches", "max_steps"):
            if getattr(self, name) < 1:
                raise ArgumentError(f"{name} must be at least 1, got {getattr(self, name)}")
        if not 0 < self.detection_probability < 1:
            raise ArgumentError(f"detection_probability must be within 0 to 1, got {self.detection_probability}")
        if not 0 <= self.unknown_ratio <= 1:
            raise ArgumentError(f"unknown_ratio must be from 0 to 1, got {self.unknown_ratio}")
        if not self.deleted_log_odds <= self.first_log_odds < self.confirmed_log_odds:
            raise ArgumentError(
                "log-odds must be deleted <= first < confirmed, got "
                f"{self.deleted_log_odds}, {self.first_log_odds}, {self.confirmed_log_odds}"
            )
