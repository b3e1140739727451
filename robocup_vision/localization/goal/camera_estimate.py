"""A camera placed by a goal and lines, and the pose that it stands for."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.goal.arc import GoalArc
from robocup_vision.localization.goal.fit import INLIER_PX, GoalFit, covariance_of
from robocup_vision.localization.goal.geometry import HEADING, X, Y, pose_of
from robocup_vision.localization.goal.search import Candidate

_POSE = np.ix_((X, Y, HEADING), (X, Y, HEADING))


@dataclass(frozen=True, eq=False)
class LineFit:
    """A camera fitted to goal and lines."""

    unknowns: FloatArray  #: (8,) float64: in the order of goal/geometry.py
    covariance: FloatArray  #: (8, 8) float64: of the unknowns
    line_ratio: float  #: inliers among the line points
    residual_px: FloatArray


@dataclass(frozen=True, eq=False)
class CameraEstimate:
    """A camera placed by a goal, or by a goal and lines; for the goal at +x."""

    #: (8,) float64: in the order of goal/geometry.py: position, heading, tilt, roll, height among them
    unknowns: FloatArray
    covariance: FloatArray  #: (8, 8) float64: of the unknowns
    sides: tuple[int, ...]  #: which goals it can be: (1,), (-1,), or both
    fit: GoalFit  #: the goal's own fit
    lines: LineFit | None  #: the fit with lines; None: the goal alone

    def estimate(self, prior: Pose2 | None = None) -> PoseEstimate:
        """Camera position on the floor and heading of the optical axis; of two candidates the prior's comes first."""
        if self.lines is not None:
            residual, ratio = self.lines.residual_px, self.lines.line_ratio
        else:
            edges = self.fit.residual_px[: len(self.fit.samples.edge)]
            residual = edges[np.abs(edges) < INLIER_PX]
            ratio = len(residual) / max(len(edges), 1)
        covariance = self.covariance[_POSE]
        pose = pose_of(self.unknowns)
        estimate = PoseEstimate(
            pose,
            (covariance + covariance.T) / 2,
            ratio,
            float(np.sqrt(np.mean(residual**2))) if len(residual) else 0.0,
            (pose,) if len(self.sides) == 1 else (pose, pose.half_turn()),
        )
        estimate = estimate.half_turn() if self.sides[0] < 0 else estimate
        if prior is not None and len(estimate.candidates) > 1:
            near, far = (math.hypot(c.x_m - prior.x_m, c.y_m - prior.y_m) for c in estimate.candidates)
            estimate = estimate.half_turn() if far < near else estimate
        return estimate


def without_lines(candidate: Candidate, arc: GoalArc | None) -> CameraEstimate:
    """Place a camera by a goal without lines; its covariance is that of the goal's whole arc where that is open."""
    found = candidate.fit
    covariance = (
        covariance_of(candidate.model, found.information) if arc is None else arc.covariance_about(found.unknowns)
    )
    return CameraEstimate(found.unknowns, covariance, candidate.sides, found, None)
