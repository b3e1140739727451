"""Fusion of the poses by several cameras of one body: products of Gaussians over the candidates that agree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2, compose_covariance, half_turn_covariance
from robocup_vision.localization.distinct import may_be_one, pose_offset
from robocup_vision.localization.filter.errors import OdometryNoise

# least covariance of a frame: (1 um)^2 and (1 urad)^2
_MIN_SPREAD = 1e-12 * np.eye(3)
# greatest sum of metres and radians between equal poses
_SAME_POSE = 1e-6


def moved(estimate: PoseEstimate, motion: Pose2, covariance: FloatArray) -> PoseEstimate:
    """Return an estimate after a motion of the body, in its frame before, with covariance (3, 3)."""
    candidates = tuple(candidate.compose(motion) for candidate in estimate.candidates)
    wider = compose_covariance(estimate.pose, estimate.covariance, motion, covariance)
    return replace(estimate, pose=candidates[0], covariance=wider, candidates=candidates)


def motion_covariance(motion: Pose2, seconds: float, noise: OdometryNoise) -> FloatArray:
    """Return the covariance (3, 3) float64 of a motion by odometry, in the body's frame before it."""
    return np.asarray(noise.slip(motion) ** 2 + noise.push(seconds))


def is_unambiguous(estimate: PoseEstimate) -> bool:
    """Whether an estimate has one candidate, or one and its half turn."""
    first, *others = estimate.candidates
    return all(sum(other.half_turn().error_to(first)) < _SAME_POSE for other in others)


def agrees(one: PoseEstimate, other: PoseEstimate) -> bool:
    """Whether any candidates of two estimates may be the same pose."""
    return bool(_pairs(one, other))


def fused(one: PoseEstimate, other: PoseEstimate) -> PoseEstimate | None:
    """Return the product of two independent estimates of one moment; None if no candidates may be the same pose.

    The covariance of a half turn of the first candidate is turned, that of others is not. Candidates of the result are
    in the order of those of `one`, then of `other`.
    """
    pairs = _pairs(one, other)
    if not pairs:
        return None
    covariance: FloatArray | None = None
    candidates: list[Pose2] = []
    for mine, my_covariance, its, its_covariance in pairs:
        gain = np.linalg.solve(my_covariance + its_covariance, my_covariance).T
        x, y, turn = (gain @ pose_offset(its, mine)).tolist()
        if covariance is None:
            product_covariance = my_covariance - gain @ my_covariance
            covariance = (product_covariance + product_covariance.T) / 2
        candidates.append(Pose2(mine.x_m + x, mine.y_m + y, mine.theta_rad + turn))
    assert covariance is not None
    inlier_ratio = 0.5 * (one.inlier_ratio + other.inlier_ratio)
    residual_px = float(np.sqrt(0.5 * (one.residual_px**2 + other.residual_px**2)))
    return PoseEstimate(candidates[0], covariance, inlier_ratio, residual_px, tuple(candidates))


def largest_group(estimates: Sequence[PoseEstimate], prior: PoseEstimate | None) -> list[list[int]]:
    """Return the largest groups of agreeing estimates of a body at one moment; a prior decides between equal ones."""
    groups: list[list[int]] = []
    for first in range(len(estimates)):
        group, together = [first], estimates[first]
        for number, other in enumerate(estimates):
            joined = None if number == first else fused(together, other)
            if joined is not None:
                group.append(number)
                together = joined
        group.sort()
        if group not in groups:
            groups.append(group)
        if len(group) == len(estimates):
            return [group]
    most = max(map(len, groups))
    largest = [group for group in groups if len(group) == most]
    if len(largest) > 1 and prior is not None:
        largest = [group for group in largest if agrees(estimates[group[0]], prior)] or largest
    return largest


def _pairs(one: PoseEstimate, other: PoseEstimate) -> list[tuple[Pose2, FloatArray, Pose2, FloatArray]]:
    """Return the pairs of candidates, with covariances, that may be the same pose."""
    found = []
    for (mine, my_covariance), (its, its_covariance) in product(_gaussians(one), _gaussians(other)):
        if may_be_one(mine, its, my_covariance + its_covariance):
            found.append((mine, my_covariance, its, its_covariance))
    return found


def _gaussians(estimate: PoseEstimate) -> list[tuple[Pose2, FloatArray]]:
    first, covariance = estimate.candidates[0], estimate.covariance + _MIN_SPREAD
    turned = half_turn_covariance(covariance)
    return [
        (pose, turned if pose is not first and sum(pose.half_turn().error_to(first)) < _SAME_POSE else covariance)
        for pose in estimate.candidates
    ]
