"""A gap between two opponents as estimated, and how well its width can be measured from a viewpoint."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.checks import require_positive
from robocup_vision.disc import Disc
from robocup_vision.normal import normal_below

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Gap:
    """An opening of uncertain width."""

    center_m: Point  #: its middle
    across_rad: float  #: direction in which it is passed, or its opposite; the opening lies at right angles to it
    #: mean and standard deviation of the estimated width: a normal distribution
    width_m: float
    sigma_m: float

    def __post_init__(self) -> None:
        if not math.isfinite(self.width_m):
            raise ArgumentError(f"width_m must be finite, got {self.width_m!r}")
        require_positive(self, "sigma_m")

    def updated(self, width_m: float, sigma_m: float) -> Gap:
        """Return the gap updated by another measurement of its width."""
        gain = self.sigma_m**2 / (self.sigma_m**2 + sigma_m**2)
        width = self.width_m + gain * (width_m - self.width_m)
        return Gap(self.center_m, self.across_rad, width, self.sigma_m * math.sqrt(1.0 - gain))

    def wide_enough(self, needed_m: float) -> float:
        """Return the probability that it is at least this wide."""
        return float(normal_below((self.width_m - needed_m) / self.sigma_m))


def gap_between(first: Disc, second: Disc) -> Gap:
    """Return the gap between two opponents: free width between their edges along the line of their centres.

    Parameters
    ----------
    first, second : Disc
        In the same frame; their errors are taken to be independent.

    Raises
    ------
    ArgumentError
        Their centres coincide.
    """
    dx, dy = second.x_m - first.x_m, second.y_m - first.y_m
    apart = math.hypot(dx, dy)
    if not apart > 0.0:
        raise ArgumentError(f"a gap needs two places, got {(first.x_m, first.y_m)} twice")
    unit = np.array([dx, dy]) / apart
    variance = float(unit @ (first.covariance + second.covariance) @ unit)
    edge_m = 0.5 * (first.radius_m + apart - second.radius_m)
    center = (first.x_m + unit[0] * edge_m, first.y_m + unit[1] * edge_m)
    width = apart - first.radius_m - second.radius_m
    return Gap((float(center[0]), float(center[1])), math.atan2(-dx, dy), width, max(math.sqrt(variance), 1e-6))


@dataclass(frozen=True, slots=True)
class WidthSensor:
    """How well one look measures a gap's width: better from nearer, and better from straight ahead.

    The camera measures the feet of two opponents, each to `angle_rad` in bearing and in depression. At distance d and
    from height h that is d * angle across the line of sight and (d^2 + h^2) / h * angle along it (the floor range is
    h / tan of the depression). With an angle phi between the line of sight and the gap's normal, the errors of both
    edges add up to sigma^2 = 2 angle^2 ((d cos phi)^2 + ((d^2 + h^2) / h sin phi)^2) + edge^2. Until the robot gets
    there the opponents may have moved: + (drift * t)^2.
    """

    angle_rad: float = 0.01  #: standard deviation of an edge's direction: about a pixel's angle, radians
    height_m: float = 0.2  #: of the camera over the floor
    edge_m: float = 0.01  #: standard deviation that remains from nearby (shape of the opponents' feet)
    drift_mps: float = 0.0  #: standard deviation of the unknown speed at which the gap widens or closes

    def __post_init__(self) -> None:
        require_positive(self, "angle_rad", "height_m", "edge_m")
        if not self.drift_mps >= 0.0:
            raise ArgumentError(f"drift_mps must not be negative, got {self.drift_mps!r}")

    def sigma_m(self, gap: Gap, eye_m: Point, until_s: float = 0.0) -> float:
        """Return the standard deviation of the width measured from `eye_m`, of the gap as it will be in `until_s`."""
        dx, dy = gap.center_m[0] - eye_m[0], gap.center_m[1] - eye_m[1]
        distance = math.hypot(dx, dy)
        phi = math.atan2(dy, dx) - gap.across_rad
        across = distance * math.cos(phi)
        along = (distance**2 + self.height_m**2) / self.height_m * math.sin(phi)
        return math.sqrt(
            2.0 * self.angle_rad**2 * (across**2 + along**2) + self.edge_m**2 + (self.drift_mps * until_s) ** 2
        )
