"""Robust least squares for camera parameters common to all frames, with the robot's pose as a nuisance in each frame.

Residuals are in pixels. A frame's nuisance parameters, the pose and the sway of the body with the camera, are
eliminated from its normal equations (Schur complement), so that the cost of a step is linear in the number of frames.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray, Int64Array

# prior precision of a frame's pose, 1/m^2 and 1/rad^2: nearly uninformative
POSE_PRECISION = 1.0
# half of the residuals of a normal distribution lie within 0.674 standard deviations
_MEDIAN_TO_STD = 1.483


class Noise(NamedTuple):
    """Noise of measured points."""

    point_std_px: float  #: standard deviation of a single point's error
    #: that of the offset common to all points of a group, from an edge's paint or tape, or a sector's lens or mirror
    group_std_px: float


@dataclass(frozen=True, slots=True, eq=False)
class Residuals:
    """Residuals of one frame's points, with their derivatives."""

    residual_px: FloatArray  #: (N,) float64: prediction minus measurement, along the normal of the edge
    by_camera: FloatArray  #: (N, G) float64: derivatives by the camera's parameters
    by_frame: FloatArray  #: (N, F) float64: derivatives by the frame's nuisance parameters
    group: Int64Array  #: (N,) int64: points of one group share an error

    def take(self, chosen: npt.NDArray[np.bool_] | slice) -> Residuals:
        """Return the points selected by a mask or a slice."""
        return Residuals(self.residual_px[chosen], self.by_camera[chosen], self.by_frame[chosen], self.group[chosen])


def spread_px(residual_px: FloatArray, min_px: float) -> float:
    """Robust standard deviation of residuals, at least `min_px`."""
    if not len(residual_px):
        return min_px
    return max(min_px, _MEDIAN_TO_STD * float(np.median(np.abs(residual_px))))


@dataclass(frozen=True, slots=True)
class Robust:
    """Weights of residuals: Tukey's biweight within a gate, and a noise estimate from the residuals inside it."""

    noise: Noise  #: least noise
    gates_px: tuple[float, ...]  #: gates of the first steps, decreasing to a few times the noise
    min_points: int  #: least number of points with weight
    last_gate: float = 3.5  #: gate of later steps, in robust standard deviations
    min_agreeing_ratio: float = 0.5  #: least ratio of points with weight, above that which other robots can hide

    def scaled(self, gates: float, noise: float) -> Robust:
        """Return these settings with gates and noise multiplied by factors."""
        point_px, group_px = self.noise
        gates_px = tuple(gates * gate for gate in self.gates_px)
        return replace(self, noise=Noise(noise * point_px, noise * group_px), gates_px=gates_px)

    def weighed(self, residual_px: FloatArray, gate_px: float) -> tuple[FloatArray, Noise]:
        """Return the weights of residuals (N,) and the noise.

        Parameters
        ----------
        gate_px : float
            Greatest residual with a weight; 0 for the last gate.

        Returns
        -------
        weight : (N,) float64
            From 0 to 1.
        noise : Noise
            If residuals exceed their expected noise, the common error is scaled up with them.
        """
        inside = np.abs(residual_px) < (gate_px or self.gates_px[-1])
        spread = spread_px(residual_px[inside], self.noise.point_std_px)
        off = np.minimum(np.abs(residual_px) / (gate_px or self.last_gate * spread), 1.0)
        noise = Noise(spread, self.noise.group_std_px * spread / self.noise.point_std_px)
        return np.asarray((1.0 - off**2) ** 2), noise

    def is_supported(self, weight: FloatArray) -> bool:
        """Whether enough points have a positive weight (N,)."""
        return int(np.count_nonzero(weight)) >= max(self.min_points, self.min_agreeing_ratio * len(weight))


@dataclass(frozen=True, slots=True, eq=False)
class FrameEquations:
    """Normal equations of one frame, for G camera parameters followed by F nuisance parameters of the frame."""

    information: FloatArray  #: (G + F, G + F) float64
    gradient: FloatArray  #: (G + F,) float64: of the log-likelihood, at the point of linearisation
    #: (F,), (F,) float64: prior precision of the nuisance parameters, and the gradient of their log-prior
    own: FloatArray
    own_gradient: FloatArray

    def reduced(self) -> tuple[FloatArray, FloatArray]:
        """Marginalise the nuisance parameters: information (G, G) on the camera's parameters, and gradient (G,)."""
        size = len(self.gradient) - len(self.own)
        cross = self.information[:size, size:]
        solved = self._own_solved(np.column_stack([cross.T, self.gradient[size:] + self.own_gradient]))
        information = self.information[:size, :size] - cross @ solved[:, :-1]
        return (information + information.T) / 2, self.gradient[:size] - cross @ solved[:, -1]

    def own_step(self, step: FloatArray) -> FloatArray:
        """Return the best step (F,) of the nuisance parameters for a step (G,) of the camera's parameters."""
        size = len(step)
        right = self.gradient[size:] + self.own_gradient - self.information[size:, :size] @ step
        return self._own_solved(right)

    def scores(self, points: Residuals, weight: FloatArray, noise: Noise) -> FloatArray:
        """Return the gradient (S, G) from each group of the points (N,), with nuisance parameters eliminated."""
        used = weight > 0
        points, weight, size = points.take(used), weight[used], points.by_camera.shape[1]
        rows = points.by_camera - points.by_frame @ self._own_solved(self.information[size:, :size])
        _, member = np.unique(points.group, return_inverse=True)
        scores = np.zeros((int(member.max(initial=-1)) + 1, size))
        np.add.at(scores, member, -rows * (weight * points.residual_px / noise.point_std_px**2)[:, None])
        return scores

    def _own_solved(self, right: FloatArray) -> FloatArray:
        size = len(self.gradient) - len(self.own)
        inner = self.information[size:, size:] + np.diag(self.own)
        return solve(inner, right)


def solve(system: FloatArray, right: FloatArray) -> FloatArray:
    """Return the solution of linear equations, like `numpy.linalg.solve`."""
    return np.asarray(np.linalg.solve(system, right), dtype=np.float64)


def frame_equations(
    points: Residuals, weight: FloatArray, noise: Noise, own: FloatArray, own_gradient: FloatArray
) -> FrameEquations:
    """Return the normal equations of weighted residuals.

    The covariance of a group is diagonal plus a rank-one term for the common offset, and is inverted by the
    Sherman-Morrison formula.

    Parameters
    ----------
    own, own_gradient : (F,) float64
        See `FrameEquations`.
    """
    used = weight > 0
    points, precision = points.take(used), weight[used] / noise.point_std_px**2
    rows = np.hstack([points.by_camera, points.by_frame, points.residual_px[:, None]])
    weighted = rows * precision[:, None]
    total = rows.T @ weighted
    if noise.group_std_px > 0 and len(rows):
        _, member = np.unique(points.group, return_inverse=True)
        common = np.zeros((int(member.max()) + 1, rows.shape[1]))
        np.add.at(common, member, weighted)
        amount = np.bincount(member, weights=precision)
        total -= common.T @ (common / (noise.group_std_px**-2 + amount)[:, None])
    return FrameEquations(total[:-1, :-1], -total[:-1, -1], own, own_gradient)


def sandwich(information: FloatArray, scores: FloatArray) -> FloatArray:
    """Covariance (G, G) of parameters from independent groups of points, whose errors may exceed the assumed noise.

    Parameters
    ----------
    information : (G, G) float64
        Information of all points and the prior.
    scores : (S, G) float64
        Gradients of the groups' log-likelihoods at the estimate.
    """
    covariance = np.linalg.inv(information)
    moved = scores @ covariance
    return np.asarray(covariance + moved.T @ moved, dtype=np.float64)
