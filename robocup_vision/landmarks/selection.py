"""Selects landmarks to search for: one of each cell of the view frustum, then the most informative ones.

Ogawa et al. (2011), section 3.2, with the success rate smoothed; the greedy choice by information is ours.
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

    #: "informative": one of each cell, of these greedily those that add most to the pose's information, up to
    #: `at_most`. "cells": one of each cell, as the paper. "frequency", "response", "random": the `at_most` of the
    #: highest success rate, of the highest contrast, or any, without cells. "all": everything expected.
    choice: Choice = "informative"
    at_most: int = 60  #: how many landmarks, but for "cells" and "all"
    #: size of a cell along u, v and depth, as fractions of the landmarks' spread (eq. 23).
    alpha: float = 0.2
    beta: float = 0.2
    gamma: float = 0.5
    by_contrast: bool = True  #: of equally successful landmarks of a cell take that of the highest contrast

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
        The map, and what a robot at this pose (3,) expects to see of it.
    prior_cov : (3, 3) float64
        How well the pose is known.
    rng : numpy.random.Generator, optional
        For "random".

    Returns
    -------
    (K,) int64
        Int64Array into `expected`; of "informative", the most informative first.
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
    """Of each cell of the view frustum (eq. 23) the landmark of the highest success rate, then contrast."""
    spread = np.array([*expected.pixels.std(axis=0), expected.depth_m.std()])
    width = np.maximum(spread * (how.alpha, how.beta, how.gamma), (1.0, 1.0, 0.01))
    u, v, z = np.floor(np.column_stack([expected.pixels, expected.depth_m]) / width).astype(np.int64).T
    cell = (u * (v.max() + 1) + v) * (z.max() + 1) + z
    order = np.lexsort((-contrast, -success, cell))
    first = np.ones(len(order), dtype=bool)
    first[1:] = cell[order][1:] != cell[order][:-1]
    return np.asarray(np.sort(order[first]))


class TimeBudget:
    """How many landmarks can be matched within a time, learnt from what earlier frames took.

    Parameters
    ----------
    limit_s : float
        For selecting, matching and fitting, without feature extraction.
    """

    def __init__(self, limit_s: float) -> None:
        if not limit_s > 0:
            raise ArgumentError(f"the time limit must be positive, got {limit_s}")
        self._limit_s = limit_s
        self._fixed_s = 0.0
        self._each_s = limit_s / 60

    @property
    def landmarks(self) -> int:
        """How many fit; never fewer than 16: not all are found, and a pose needs 6."""
        return max(math.floor((self._limit_s - self._fixed_s) / self._each_s), 16)

    def learn(self, fixed_s: float, matching_s: float, landmarks: int) -> None:
        """Take account of a frame: the time apart from matching, that of matching, and how many were matched."""
        if landmarks:
            self._each_s = 0.8 * self._each_s + 0.2 * max(matching_s / landmarks, 1e-7)
            self._fixed_s = 0.8 * self._fixed_s + 0.2 * min(fixed_s, self._limit_s)
