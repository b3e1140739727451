"""What hides what: the chance that a robot, whose place is uncertain, stands between a camera and a point."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray, read_only

_HALF_ROOT = math.sqrt(0.5)


@dataclass(frozen=True, slots=True, eq=False)
class Blocker:
    """An upright cylinder that may stand in the way of a look, as a tracker believes it.

    Parameters
    ----------
    x_m, y_m : float
        Its axis, field frame.
    radius_m : float
        Its radius.
    covariance : (2, 2) float64
        Of its axis, square metres.
    height_m : float
        How high it is; infinite where that is not known.
    """

    x_m: float
    y_m: float
    radius_m: float
    covariance: FloatArray
    height_m: float = math.inf

    def __post_init__(self) -> None:
        covariance = read_only(self.covariance)
        if covariance.shape != (2, 2):
            raise ArgumentError(f"a blocker's covariance must be (2, 2), got {covariance.shape}")
        if not (math.isfinite(self.x_m) and math.isfinite(self.y_m) and np.isfinite(covariance).all()):
            raise ArgumentError(f"a blocker's place must be finite, got ({self.x_m}, {self.y_m})")
        if not self.radius_m > 0:
            raise ArgumentError(f"a blocker's radius_m must be positive, got {self.radius_m}")
        object.__setattr__(self, "covariance", covariance)


def clear_probability(eye_m: npt.ArrayLike, points_m: npt.ArrayLike, blockers: Sequence[Blocker]) -> FloatArray:
    """Chance (N,) that nothing hides a point from the camera.

    Parameters
    ----------
    eye_m : (3,) float64
        The camera, field frame.
    points_m : (N, 3) float64
        What is looked at, field frame.
    blockers : sequence of Blocker
        What may stand between; each independent of the others.
    """
    eye, points = np.asarray(eye_m, dtype=np.float64), np.asarray(points_m, dtype=np.float64).reshape(-1, 3)
    share = np.ones(len(points))
    way = points[:, :2] - eye[:2]
    away = np.maximum(np.hypot(way[:, 0], way[:, 1]), 1e-9)
    along, across = way / away[:, None], np.column_stack([-way[:, 1], way[:, 0]]) / away[:, None]
    for blocker in blockers:
        offset = np.array([blocker.x_m, blocker.y_m]) - eye[:2]
        at, aside = along @ offset, across @ offset
        sight_height = eye[2] + (points[:, 2] - eye[2]) * np.clip(at / away, 0.0, 1.0)
        between = (at > 0) & (at < away) & (sight_height < blocker.height_m)
        std = np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", across, blocker.covariance, across), 1e-12))
        for n in np.flatnonzero(between & (np.abs(aside) < blocker.radius_m + 5 * std)):
            low, high = (_HALF_ROOT * (edge - aside[n]) / std[n] for edge in (-blocker.radius_m, blocker.radius_m))
            share[n] *= 1 - (math.erf(high) - math.erf(low)) / 2
    return share
