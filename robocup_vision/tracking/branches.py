"""The branches of all track trees as arrays: predicted and split over the detections, chosen together, and pruned."""

from __future__ import annotations

import math
from collections.abc import Set
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.checks import require_at_least, require_positive
from robocup_vision.kernels.tracking import branches as kernel
from robocup_vision.kernels.tracking.branches import MISS
from robocup_vision.kernels.tracking.choice import choose_together, keep_near
from robocup_vision.normal import GATE_2D

# time constant with which a predicted velocity decays, because objects stop or turn
_STEADY_S = 1.5
_LIFETIME_S = 100.0  # mean time for which an object stays on the field
# least fraction of the covariance after a missed detection: its nine points cannot resolve less
_UNKNOWN_RATIO = 0.05
# number of frames after which a choice between branches is final; branches with equal detections in them are merged
_HISTORY_FRAMES = 5
# greatest log-likelihood ratio of a tree's best branch to another one that is kept
_MAX_LOG_RATIO = 7.0
_MAX_BRANCHES = 12  # greatest number of branches of each object's tree
# greatest number of steps of the joint choice of branches, which bounds its time
MAX_STEPS = 1000


@dataclass(frozen=True, slots=True)
class MovingObjectsSettings:
    """Settings of `MovingObjects`.

    Raises
    ------
    ArgumentError
        If one of them is out of range.
    """

    #: standard deviation of the objects' acceleration, white noise in the filters
    acceleration_mps2: float = 1.5
    speed_mps: float = 0.7  #: standard deviation of a new object's velocity along each axis
    detection_probability: float = 0.8  #: probability that an object which nothing hides is detected in a frame
    clutter_per_m2: float = 0.2  #: number of false detections per frame and square metre
    #: width of the objects, by which they hide others; and the distance within which detections belong to one object
    width_m: float = 0.18
    first_log_odds: float = -3.0  #: log-odds that a detection without a track is a new object
    #: log-odds from which on an object is reported, and below which it is deleted: hysteresis prevents flicker
    confirmed_log_odds: float = 4.0
    deleted_log_odds: float = -3.0
    min_frames: int = 3  #: least number of detections of a reported object
    coast_s: float = 3.0  #: longest time without a detection before an object is deleted

    def __post_init__(self) -> None:
        require_positive(
            self,
            "acceleration_mps2",
            "speed_mps",
            "clutter_per_m2",
            "width_m",
            "coast_s",
        )
        require_at_least(self, 1, "min_frames")
        if not 0 < self.detection_probability < 1:
            raise ArgumentError(f"detection_probability must be within 0 to 1, got {self.detection_probability}")
        if not self.deleted_log_odds <= self.first_log_odds < self.confirmed_log_odds:
            raise ArgumentError(
                "log-odds must be deleted <= first < confirmed, got "
                f"{self.deleted_log_odds}, {self.first_log_odds}, {self.confirmed_log_odds}"
            )


@dataclass(frozen=True, slots=True, eq=False)
class Branches:
    """Branches of track trees."""

    tree: Int64Array  #: (L,) int64: number of each branch's tree
    mean: FloatArray  #: (L, 4) float64: x, y, vx, vy in the field frame, m and m/s
    covariance: FloatArray  #: (L, 4, 4) float64: covariance of the mean
    evidence: FloatArray  #: (L,) float64: log-likelihood ratio of all its detections and misses against clutter
    odds: FloatArray  #: (L,) float64: log-odds that the object is still there
    coasted_s: FloatArray  #: (L,) float64: seconds since the last detection
    missed: Int64Array  #: (L,) int64: frames since the last detection
    history: Int64Array  #: (L, H) int64: running numbers of the last H frames' detections, newest first; -1 for a miss

    def __len__(self) -> int:
        return len(self.tree)

    @classmethod
    def initiated(
        cls,
        trees: Int64Array,
        places_m: FloatArray,
        spreads: FloatArray,
        detections: Int64Array,
        settings: MovingObjectsSettings,
    ) -> Branches:
        """Return one branch for each tree that begins at a detection."""
        count = len(trees)
        mean = np.zeros((count, 4))
        mean[:, :2] = places_m
        covariance = np.zeros((count, 4, 4))
        covariance[:, :2, :2] = spreads
        covariance[:, 2, 2] = covariance[:, 3, 3] = settings.speed_mps**2
        history = np.full((count, _HISTORY_FRAMES), MISS, dtype=np.int64)
        history[:, 0] = detections
        first, zeros, never = np.full(count, settings.first_log_odds), np.zeros(count), np.zeros(count, dtype=np.int64)
        return cls(trees, mean, covariance, first, first.copy(), zeros, never, history)

    def select(self, chosen: Int64Array) -> Branches:
        """Return the branches with these indices, in this order."""
        arrays: Any = self._arrays()
        return Branches(*(array[chosen] for array in arrays))

    def without(self, trees: Set[int]) -> Branches:
        """Return the branches of all other trees."""
        return self.select(
            np.array([n for n, tree in enumerate(self.tree.tolist()) if tree not in trees], dtype=np.int64)
        )

    def concatenate(self, other: Branches) -> Branches:
        """Return these branches followed by others."""
        pairs: Any = zip(self._arrays(), other._arrays(), strict=True)
        return Branches(*map(np.concatenate, pairs))

    def split(
        self,
        seconds: float,
        places_m: FloatArray,
        spreads: FloatArray,
        numbers: Int64Array,
        eye_m: FloatArray,
        settings: MovingObjectsSettings,
    ) -> Branches:
        """Return one branch without a detection for each of these, and one for each detection within its gate.

        Parameters
        ----------
        seconds : float
            Time since the frame of these branches.
        places_m, spreads : (M, 2) and (M, 2, 2) float64
            Detections in the field frame and their covariances.
        numbers : (M,) int64
            Running numbers of the detections.
        eye_m : (2,) float64
            Place of the robot in the field frame: an undetected object is more probable where detections hide it.
        """
        kept = math.exp(-seconds / _STEADY_S)
        noise = settings.acceleration_mps2**2
        motion = kernel.MotionModel(
            seconds,
            _STEADY_S * (1 - kept),
            kept,
            0.25 * seconds**4 * noise,
            0.5 * seconds**3 * noise,
            seconds**2 * noise,
            math.exp(-seconds / _LIFETIME_S),
        )
        model = kernel.DetectionModel(settings.detection_probability, settings.clutter_per_m2, GATE_2D, _UNKNOWN_RATIO)
        return Branches(
            *kernel.predict_and_split(
                self._arrays(),
                motion,
                kernel.Detected(places_m, spreads, numbers),
                kernel.Eye(float(eye_m[0]), float(eye_m[1]), 0.5 * settings.width_m),
                model,
            )
        )

    def choose_together(self, max_steps: int) -> Int64Array:
        """Return the indices (B,) of the jointly most likely branches: at most one of each tree, no common detections.

        After `max_steps` steps of the search the best choice so far is taken.
        """
        return np.flatnonzero(choose_together(self.tree, self.evidence, self.history, max_steps))

    def pruned(self, chosen: Int64Array) -> Branches:
        """Return the best branches of the trees of the chosen ones (B,), see `keep_near`."""
        is_chosen = np.zeros(len(self), dtype=np.bool_)
        is_chosen[chosen] = True
        kept = keep_near(self.tree, self.evidence, self.history, is_chosen, _MAX_LOG_RATIO, _MAX_BRANCHES)
        return self.select(kept)

    def _arrays(self) -> kernel.BranchArrays:
        return kernel.BranchArrays(*(getattr(self, field.name) for field in fields(self)))
