"""Selects landmarks to search for: one of each cell of the view frustum, then the most informative ones.

Ogawa et al. (2011), section 3.2, with a smoothed success rate. The greedy choice by information is an addition.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.checks import require_at_least
from robocup_vision.kernels.landmarks.fit import most_informative
from robocup_vision.landmarks.features import PIXEL_STD_PER_SPACING
from robocup_vision.landmarks.landmark_map import Expected, LandmarkMap, pinhole_view

Choice = Literal["informative", "cells", "frequency", "response", "random", "all"]
CHOICES: tuple[Choice, ...] = ("informative", "cells", "frequency", "response", "random", "all")


@dataclass(frozen=True, slots=True)
class Selection:
    """How landmarks are chosen."""

    #: "informative": one of each cell, and of these greedily those that add most to the pose's information, up to
    #: `at_most`. "cells": one of each cell, as in the paper. "frequency", "response", "random": the `at_most` with the
    #: highest success rate, with the highest contrast, or random ones, without cells. "all": all expected ones.
    choice: Choice = "informative"
    at_most: int = 60  #: greatest number of landmarks, except for "cells" and "all"
    #: size of a cell along u, v and depth, as fractions of the landmarks' spread (eq. 23).
    alpha: float = 0.2
    beta: float = 0.2
    gamma: float = 0.5
    by_contrast: bool = True  #: whether contrast decides between landmarks of a cell with equal success rates

    def __post_init__(self) -> None:
        if self.choice not in CHOICES:
            raise ArgumentError(f"choice must be one of {', '.join(CHOICES)}, got {self.choice!r}")
        require_at_least(self, 1, "at_most")
        if not (self.alpha > 0 and self.beta > 0 and self.gamma > 0):
            raise ArgumentError(f"alpha, beta, gamma must be positive, got {self.alpha}, {self.beta}, {self.gamma}")


def select(
    how: Selection,
    landmarks: LandmarkMap,
    expected: Expected,
    camera: PinholeCamera,
    pose: FloatArray,
    prior_cov: FloatArray,
    *,
    at_most: int | None = None,
    rng: np.random.Generator | None = None,
) -> Int64Array:
    """Choose among the expected landmarks.

    Parameters
    ----------
    landmarks, expected, camera, pose
        The map, and the landmarks expected at a robot's pose (3,).
    prior_cov : (3, 3) float64
        Covariance of the pose.
    at_most : int, optional
        Greatest number of landmarks; by default that of `how`.
    rng : numpy.random.Generator, optional
        Generator for the selection "random".

    Returns
    -------
    (K,) int64
        Indices into `expected`; for "informative" the most informative first.
    """
    count = how.at_most if at_most is None else at_most
    everything = np.arange(len(expected))
    if how.choice == "all" or not len(expected):
        return everything
    success = landmarks.success[expected.landmark]
    contrast = landmarks.view_contrast[expected.view]
    if how.choice == "random":
        if rng is None:
            raise ArgumentError("choice 'random' needs an rng")
        return np.sort(rng.permutation(everything)[:count])
    if how.choice == "response":
        return np.argsort(-contrast, kind="stable")[:count]
    if how.choice == "frequency":
        return np.argsort(-success, kind="stable")[:count]
    chosen = delegates(expected, success, contrast if how.by_contrast else np.zeros_like(contrast), how)
    if how.choice == "cells":
        return chosen
    of = expected.landmark[chosen]
    best = most_informative(
        pinhole_view(camera), pose, landmarks.positions_m[of], landmarks.covariances[of],
        PIXEL_STD_PER_SPACING * landmarks.noise[of] * np.maximum(expected.spacing_px[chosen], 0.5), success[chosen],
        np.asarray(np.linalg.inv(prior_cov), dtype=np.float64), count,
    )  # fmt: skip
    return chosen[best]


def delegates(expected: Expected, success: FloatArray, contrast: FloatArray, how: Selection) -> Int64Array:
    """Return the landmark of the highest success rate, then contrast, in each cell of the view frustum (eq. 23)."""
    spread = np.array([*expected.pixels.std(axis=0), expected.depth_m.std()])
    width = np.maximum(spread * (how.alpha, how.beta, how.gamma), (1.0, 1.0, 0.01))
    u, v, z = np.floor(np.column_stack([expected.pixels, expected.depth_m]) / width).astype(np.int64).T
    cell = (u * (v.max() + 1) + v) * (z.max() + 1) + z
    order = np.lexsort((-contrast, -success, cell))
    first = np.ones(len(order), dtype=bool)
    first[1:] = cell[order][1:] != cell[order][:-1]
    return np.asarray(np.sort(order[first]))


class TimeBudget:
    """Number of landmarks that can be matched within a time, learnt from the times of earlier frames.

    Parameters
    ----------
    limit_s : float
        Time for selection, matching and fit, without feature extraction.
    """

    def __init__(self, limit_s: float) -> None:
        if not limit_s > 0:
            raise ArgumentError(f"the time limit must be positive, got {limit_s}")
        self._limit_s = limit_s
        self._fixed_s = 0.0
        self._each_s = limit_s / 60

    @property
    def landmarks(self) -> int:
        """Number of landmarks, at least 16, because a pose needs 6 and not all are found."""
        return max(math.floor((self._limit_s - self._fixed_s) / self._each_s), 16)

    def learn(self, fixed_s: float, matching_s: float, landmarks: int) -> None:
        """Update with a frame's other time, its time of matching, and the number of landmarks to match."""
        if landmarks:
            self._each_s = 0.8 * self._each_s + 0.2 * max(matching_s / landmarks, 1e-7)
            self._fixed_s = 0.8 * self._fixed_s + 0.2 * min(fixed_s, self._limit_s)
