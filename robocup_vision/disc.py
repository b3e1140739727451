"""A round thing that stands or moves on the floor: the shape of other robots for all planners."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray, read_only


def _zero_covariance() -> FloatArray:
    return np.zeros((2, 2))


@dataclass(frozen=True, slots=True, eq=False)
class Disc:
    """An upright cylinder on the floor: a robot, a box, a post.

    Raises
    ------
    ArgumentError
        If a centre, velocity or covariance is not finite, a covariance is not (2, 2), or a size is negative.
    """

    #: present place of its centre, in the planner's frame
    x_m: float
    y_m: float
    radius_m: float
    #: (2, 2) float64: covariance of the centre, square metres; without it the centre is exact
    covariance: FloatArray = field(default_factory=_zero_covariance)
    #: velocity over ground, along the axes of the same frame
    vx_mps: float = field(default=0.0, kw_only=True)
    vy_mps: float = field(default=0.0, kw_only=True)
    #: (2, 2) float64: covariance of the velocity, (m/s)^2; without it the velocity is exact
    velocity_covariance: FloatArray = field(default_factory=_zero_covariance, kw_only=True)
    height_m: float = field(default=math.inf, kw_only=True)  #: height; infinite if it is not known

    def __post_init__(self) -> None:
        for name in ("x_m", "y_m", "vx_mps", "vy_mps"):
            if not math.isfinite(getattr(self, name)):
                raise ArgumentError(f"a disc's {name} must be finite, got {getattr(self, name)!r}")
        if not (math.isfinite(self.radius_m) and self.radius_m >= 0.0):
            raise ArgumentError(f"a disc's radius_m must not be negative, got {self.radius_m!r}")
        if not self.height_m >= 0.0:
            raise ArgumentError(f"a disc's height_m must not be negative, got {self.height_m!r}")
        for name in ("covariance", "velocity_covariance"):
            covariance = read_only(getattr(self, name))
            if covariance.shape != (2, 2) or not np.isfinite(covariance).all():
                raise ArgumentError(f"a disc's {name} must be (2, 2) and finite, got {covariance.tolist()}")
            object.__setattr__(self, name, covariance)

    @property
    def variance_m2(self) -> float:
        """Variance of the centre, along the direction in which it is largest."""
        return float(np.linalg.eigvalsh(self.covariance)[-1])

    @property
    def std_m(self) -> float:
        """Standard deviation of the centre, along the direction in which it is largest."""
        return math.sqrt(max(self.variance_m2, 0.0))

    @property
    def velocity_std_mps(self) -> float:
        """Standard deviation of the velocity, along the direction in which it is largest."""
        return math.sqrt(max(float(np.linalg.eigvalsh(self.velocity_covariance)[-1]), 0.0))
