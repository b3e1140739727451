"""A camera placed by a goal and lines, the pose that it stands for, and what a picture shows of the goal there."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.goal.arc import open_arc
from robocup_vision.localization.goal.edges import measure
from robocup_vision.localization.goal.fit import GoalFit, covariance_of, residuals
from robocup_vision.localization.goal.geometry import EDGES, HEADING, LOG_FOCAL, IdealView, X, Y, pose_of
from robocup_vision.localization.goal.line_marks import LineFit
from robocup_vision.localization.goal.search import Candidate

_POSE = np.ix_((X, Y, HEADING), (X, Y, HEADING))


@dataclass(frozen=True, eq=False)
class CameraEstimate:
    """A camera placed by a goal, by the lines around it, or by both; for the goal at +x.

    Parameters
    ----------
    unknowns : (8,) float64
        In the order of goal/geometry.py: position, heading, tilt, roll, height among them.
    covariance : (8, 8) float64
        Of the unknowns.
    sides : tuple of int
        Which goals it can be: (1,), (-1,), or both.
    fit : GoalFit or None
        The goal's own fit; None: lines alone.
    lines : LineFit or None
        The fit with lines; None: the goal alone.
    """

    unknowns: FloatArray
    covariance: FloatArray
    sides: tuple[int, ...]
    fit: GoalFit | None
    lines: LineFit | None

    def estimate(self, prior: Pose2 | None = None) -> PoseEstimate:
        """Camera position on the floor and heading of the optical axis; of two candidates the prior's comes first."""
        estimate = _estimate(self)
        if prior is not None and len(estimate.candidates) > 1:
            near, far = (math.hypot(c.x_m - prior.x_m, c.y_m - prior.y_m) for c in estimate.candidates)
            estimate = estimate.half_turn() if far < near else estimate
        return estimate


def _estimate(camera: CameraEstimate) -> PoseEstimate:
    if camera.lines is not None:
        residual, ratio = camera.lines.residual_px, camera.lines.line_ratio
    else:
        assert camera.fit is not None
        edges = camera.fit.residual_px[: len(camera.fit.samples.edge)]
        residual = edges[np.abs(edges) < camera.fit.settings.inlier_px]
        ratio = len(residual) / max(len(edges), 1)
    covariance = camera.covariance[_POSE]
    pose = pose_of(camera.unknowns)
    estimate = PoseEstimate(
        pose,
        (covariance + covariance.T) / 2,
        ratio,
        float(np.sqrt(np.mean(residual**2))) if len(residual) else 0.0,
        (pose,) if len(camera.sides) == 1 else (pose, pose.half_turn()),
    )
    return estimate.half_turn() if camera.sides[0] < 0 else estimate


def goal_alone(candidate: Candidate, certain_m: float) -> CameraEstimate:
    """Place a camera by a goal without lines.

    Parameters
    ----------
    candidate : Candidate
        The goal.
    certain_m : float
        Where the position is less certain (one standard deviation), the covariance is that of the goal's whole arc.
    """
    found, model = candidate.fit, candidate.model
    covariance = covariance_of(model, found.information)
    arc = open_arc(model, found, covariance, certain_m)
    if arc is not None and len(arc.cost):
        covariance = arc.covariance_about(found.unknowns)
    return CameraEstimate(found.unknowns, covariance, candidate.sides, found, None)


def shown_ratios(
    frame: UInt8Array, camera: PinholeCamera, candidate: Candidate, unknowns: FloatArray, reach_px: float
) -> FloatArray:
    """(3,) float64: how much of the better edge of each post and of the bar is so near to where it is due.

    Before a bright wall one edge of a post may be all there is.
    """
    scale = math.exp(float(unknowns[LOG_FOCAL]))
    fu, fv = camera.focal_px
    view = IdealView((fu * scale, fv * scale), camera.center_px)
    model = candidate.model
    edges = model.settings.edges
    samples = measure(frame, camera, view, model.shape, unknowns, reach_px, candidate.appearance, edges)
    if samples is None:
        return np.zeros(3)
    near = np.abs(residuals(model, samples, unknowns)[: len(samples.edge)]) < reach_px
    ratio = np.bincount(samples.edge[near], minlength=EDGES) / np.maximum(samples.expected, 4)
    return np.asarray(ratio.reshape(3, 2).max(axis=1))
