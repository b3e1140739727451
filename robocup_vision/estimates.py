"""Result of a localiser: a pose with its covariance and candidates, or the reason why there is none (falsy)."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from typing import Literal

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray, read_only
from robocup_vision.geometry import Pose2, compose_covariance, half_turn_covariance


@dataclass(frozen=True, slots=True, eq=False)
class PoseEstimate:
    """An estimated pose on the field.

    Parameters
    ----------
    pose : Pose2
        The first candidate: pose of the robot in the field frame (method "goal": of the camera).
    covariance : (3, 3) float64
        Covariance of (x_m, y_m, theta_rad), in m, m and rad.
    inlier_ratio : float
        Fraction of the measurements that agree with the pose, 0 to 1.
    residual_px : float
        Root mean square of the inliers' residuals, pixels.
    candidates : tuple of Pose2
        All poses that fit the frame, `pose` first; two on a point-symmetric field if nothing separates its halves.
    """

    pose: Pose2
    covariance: FloatArray
    inlier_ratio: float
    residual_px: float
    candidates: tuple[Pose2, ...] = field(default=())

    def __post_init__(self) -> None:
        covariance = read_only(self.covariance)
        if covariance.shape != (3, 3):
            raise ArgumentError(f"covariance must be (3, 3), got {covariance.shape}")
        object.__setattr__(self, "covariance", covariance)
        if not self.candidates:
            object.__setattr__(self, "candidates", (self.pose,))
        elif self.candidates[0] is not self.pose and self.candidates[0] != self.pose:
            raise ArgumentError(f"the first of the candidates must be the pose {self.pose}, got {self.candidates[0]}")

    @property
    def x_m(self) -> float:
        """Coordinate x of the pose, field frame."""
        return self.pose.x_m

    @property
    def y_m(self) -> float:
        """Coordinate y of the pose, field frame."""
        return self.pose.y_m

    @property
    def theta_rad(self) -> float:
        """Heading of the pose, field frame."""
        return self.pose.theta_rad

    def __bool__(self) -> Literal[True]:
        return True

    @property
    def std(self) -> FloatArray:
        """(3,) float64: standard deviations of x (m), y (m) and theta (rad)."""
        return np.sqrt(np.diag(self.covariance))

    def seen_from(self, mount: Pose2) -> PoseEstimate:
        """Return the estimate, with its candidates, of a frame at the pose `mount` in this one's frame."""
        candidates, covariance = tuple(candidate.compose(mount) for candidate in self.candidates), self.covariance
        # a mere rotation, as of a head that pans, does not change the covariance
        if mount.x_m or mount.y_m:
            covariance = compose_covariance(self.pose, covariance, mount, np.zeros((3, 3)))
        return PoseEstimate(candidates[0], covariance, self.inlier_ratio, self.residual_px, candidates)

    def half_turn(self) -> PoseEstimate:
        """Return the estimate turned by pi about the field's centre, with its candidates in the same order."""
        candidates = tuple(candidate.half_turn() for candidate in self.candidates)
        return PoseEstimate(
            candidates[0], half_turn_covariance(self.covariance), self.inlier_ratio, self.residual_px, candidates
        )


@dataclass(frozen=True, slots=True)
class NotLocated:
    """No pose is determined by this frame. It is falsy, so that `if view.pose:` works.

    Parameters
    ----------
    reason : str
        The reason, in words that a user understands.
    """

    reason: str

    def __bool__(self) -> Literal[False]:
        return False


@dataclass(frozen=True, slots=True)
class SwappedChannels(NotLocated):
    """No pose, because red and blue seem to be swapped, and the half found by the goals' colours would be wrong."""


class EdgeState(IntEnum):
    """What was found at the predicted place of an edge of the field.

    `UNSEEN`: too faint to be searched for; `FOUND`; `HIDDEN`: something is in front of it; `MISSING`: plain carpet.
    """

    UNSEEN = 0
    FOUND = 1
    HIDDEN = 2
    MISSING = 3


@dataclass(frozen=True, slots=True, eq=False)
class EdgePoints:
    """Places on edges of the field that a pose predicts in a frame."""

    pixels: FloatArray  #: (N, 2) float64: predicted places, u and v
    state: npt.NDArray[np.uint8]  #: (N,) uint8: what was found there, values of `EdgeState`

    def __post_init__(self) -> None:
        object.__setattr__(self, "pixels", read_only(self.pixels))
        state = np.array(self.state, dtype=np.uint8)
        state.flags.writeable = False
        object.__setattr__(self, "state", state)


def pose_of(prior: PoseEstimate | Pose2 | None) -> Pose2 | None:
    """Return the pose of a prior, which may itself be a pose or None."""
    return prior.pose if isinstance(prior, PoseEstimate) else prior
