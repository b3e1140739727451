"""Error and NEES of each image's pose, and the figures over all images.

Ratios refer to all images, so one that was not located, could not be read or has no truth never improves a figure.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from robocup_vision.estimates import PoseEstimate
from robocup_vision.evaluation.dataset import Truth
from robocup_vision.evaluation.detections import Detection
from robocup_vision.geometry import Pose2, wrap_angle

NEAR_M, NEAR_RAD = 0.05, math.radians(3.0)
FAIR_M, FAIR_RAD = 0.10, math.radians(5.0)
NEES_95 = 7.8147  # 95 % quantile of chi-squared with 3 degrees of freedom


@dataclass(frozen=True, slots=True)
class PoseError:
    """Error of an estimated pose."""

    #: estimate minus truth, field frame
    x_m: float
    y_m: float
    theta_rad: float | None  #: estimate minus truth, wrapped into (-pi, pi]; None if the truth has no heading
    #: e^T P^-1 e over x, y and theta; infinite if P is singular, None if the truth has no heading
    nees: float | None

    @property
    def position_m(self) -> float:
        """Distance from the truth."""
        return math.hypot(self.x_m, self.y_m)

    def within(self, position_m: float, heading_rad: float) -> bool:
        """Whether position and heading are both known, and within these bounds."""
        return self.theta_rad is not None and self.position_m <= position_m and abs(self.theta_rad) <= heading_rad


def pose_error(estimate: PoseEstimate, truth: Truth | Pose2, *, symmetric: bool) -> PoseError:
    """Compare an estimate's first candidate with the truth.

    Parameters
    ----------
    truth : Truth or Pose2
        True pose of the robot, or of the camera if `pose_of` is "camera".
    symmetric : bool
        Whether the error counts modulo a half turn about the field's centre. The turned estimate is used if the sum of
        its errors (`Pose2.error_to`) is smaller; without a true heading, if its position is nearer.
    """
    turned = estimate.half_turn()
    if symmetric and _distance(turned.pose, truth) < _distance(estimate.pose, truth):
        estimate = turned
    x_m, y_m = estimate.pose.x_m - truth.x_m, estimate.pose.y_m - truth.y_m
    if truth.theta_rad is None:
        return PoseError(x_m, y_m, None, None)
    theta_rad = wrap_angle(estimate.pose.theta_rad - truth.theta_rad)
    return PoseError(x_m, y_m, theta_rad, _nees(np.array([x_m, y_m, theta_rad]), estimate.covariance))


def _distance(pose: Pose2, truth: Truth | Pose2) -> float:
    heading_rad = pose.theta_rad if truth.theta_rad is None else truth.theta_rad
    return sum(pose.error_to(Pose2(truth.x_m, truth.y_m, heading_rad)))


def _nees(error: np.ndarray[tuple[int], np.dtype[np.float64]], covariance: np.ndarray[tuple[int, ...]]) -> float:
    try:
        lower = np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:
        return math.inf
    return float(np.sum(np.linalg.solve(lower, error) ** 2))


@dataclass(frozen=True, slots=True)
class SteerResult:
    """The command that a frame led to."""

    target_bearing_rad: float  #: direction to the target, robot frame
    #: velocity before, and the commanded velocity, robot frame
    velocity_mps: tuple[float, float]
    command_mps: tuple[float, float]
    safe: bool  #: whether the robot does not touch anything that the frame shows
    reason: str  #: why this command was chosen
    time_s: float  #: how long steering took


@dataclass(frozen=True, slots=True)
class Row:
    """One image's line in the results."""

    image: str
    estimate: PoseEstimate | None = None  #: None if it was not located
    truth: Truth | None = None  #: None if it is unknown
    error: PoseError | None = None  #: None if it was not located or there is no truth
    time_s: float | None = None  #: how long the localiser took; None if it did not get the image
    reason: str = ""  #: why it was not located, else empty
    failed: bool = False  #: the image could not be used, or the localiser raised an error
    unreadable: bool = False  #: the image could not be used
    steering: SteerResult | None = None  #: None if no command was computed from it
    detections: tuple[Detection, ...] = ()  #: its boxes, hit or missed, and the false detections

    @property
    def status(self) -> Literal["located", "not_located", "unreadable"]:
        """Outcome for the image, as in results.csv."""
        if self.unreadable:
            return "unreadable"
        return "not_located" if self.estimate is None else "located"

    @property
    def severity(self) -> tuple[float, float]:
        """Sort key, larger is worse: failed images first, then those not located, then by error, else by residual."""
        if self.estimate is None:
            return (3.0 if self.failed else 2.0), 0.0
        if self.error is not None:
            return 1.0, self.error.position_m / NEAR_M + abs(self.error.theta_rad or 0.0) / NEAR_RAD
        return 0.0, self.estimate.residual_px


@dataclass(frozen=True, slots=True)
class Figures:
    """The figures over all images; None if there was nothing to compute one from."""

    #: number of images, of those whose true place is known, and of those that got a pose
    images: int
    with_truth: int
    located: int
    #: fraction of all images, 0 to 1, with position and heading that near the truth; None without any true heading
    within_5cm_3deg: float | None
    within_10cm_5deg: float | None
    #: over the located images with truth
    median_error_m: float | None
    median_error_rad: float | None
    rms_x_m: float | None
    rms_y_m: float | None
    rms_theta_rad: float | None
    #: over the located images with a true heading, 3 degrees of freedom; None also if a covariance is singular
    nees_mean: float | None
    #: likewise the median, and the fraction within the 95 % bound, which is 0.95 if the covariances are right
    nees_median: float | None
    nees_inside_95: float | None
    median_ms: float | None  #: median time of the localiser, over the images that it got


def figures(rows: Sequence[Row]) -> Figures:
    """Compute the figures over all images."""
    errors = [row.error for row in rows if row.error is not None]
    headings = [error.theta_rad for error in errors if error.theta_rad is not None]
    nees = [error.nees for error in errors if error.nees is not None]
    scored = any(row.truth is not None and row.truth.theta_rad is not None for row in rows)

    def ratio_within(position_m: float, heading_rad: float) -> float | None:
        return sum(error.within(position_m, heading_rad) for error in errors) / len(rows) if scored else None

    return Figures(
        images=len(rows),
        with_truth=sum(row.truth is not None for row in rows),
        located=sum(row.estimate is not None for row in rows),
        within_5cm_3deg=ratio_within(NEAR_M, NEAR_RAD),
        within_10cm_5deg=ratio_within(FAIR_M, FAIR_RAD),
        median_error_m=_median([error.position_m for error in errors]),
        median_error_rad=_median([abs(heading) for heading in headings]),
        rms_x_m=_rms([error.x_m for error in errors]),
        rms_y_m=_rms([error.y_m for error in errors]),
        rms_theta_rad=_rms(headings),
        nees_mean=_mean(nees),
        nees_median=_median(nees) if all(map(math.isfinite, nees)) else None,
        nees_inside_95=_mean([float(value <= NEES_95) for value in nees]),
        median_ms=_median([1e3 * row.time_s for row in rows if row.time_s is not None]),
    )


def _median(values: list[float]) -> float | None:
    return float(np.median(values)) if values else None


def _mean(values: list[float]) -> float | None:
    return float(np.mean(values)) if values and all(map(math.isfinite, values)) else None


def _rms(values: list[float]) -> float | None:
    return math.sqrt(sum(value * value for value in values) / len(values)) if values else None
