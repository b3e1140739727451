"""Robust least squares of a camera: its parameters are common to all frames, the robot's pose is another in each.

Residuals are in pixels. A frame's own unknowns, its pose and the sway of the body that carries the camera, are
eliminated from its normal equations (Schur complement). Residuals that they could explain do not change the camera, and
a step costs as much as its frames.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray, Int64Array

# precision of a frame's pose under its prior, 1/m^2 and 1/rad^2: next to nothing is known
POSE_PRECISION = 1.0
# half of the residuals of a normal distribution lie within 0.674 standard deviations
_MEDIAN_TO_STD = 1.483


class Noise(NamedTuple):
    """Noise of measured points."""

    point_std_px: float  #: standard deviation of a point alone
    #: that of the offset which all points of a group share: an edge's paint and tape, a sector's lens or mirror
    group_std_px: float


@dataclass(frozen=True, slots=True, eq=False)
class Residuals:
    """Residuals of one frame's points, with their derivatives."""

    residual_px: FloatArray  #: (N,) float64: expected less measured, along the normal of the edge
    by_camera: FloatArray  #: (N, G) float64: derivatives by the camera's parameters
    by_frame: FloatArray  #: (N, F) float64: derivatives by the frame's own unknowns
    group: Int64Array  #: (N,) int64: points of one number have a common error

    def take(self, chosen: npt.NDArray[np.bool_] | slice) -> Residuals:
        """Return the points where a mask is true, or of a slice."""
        return Residuals(self.residual_px[chosen], self.by_camera[chosen], self.by_frame[chosen], self.group[chosen])


def spread_px(residual_px: FloatArray, min_px: float) -> float:
    """Robust standard deviation of residuals, at least `min_px`."""
    if not len(residual_px):
        return min_px
    return max(min_px, _MEDIAN_TO_STD * float(np.median(np.abs(residual_px))))


@dataclass(frozen=True, slots=True)
class Robust:
    """How residuals are weighed: by Tukey's function within a gate, and by the noise that they show within it."""

    noise: Noise  #: at least
    gates_px: tuple[float, ...]  #: of the steps, down to a few times the noise
    min_points: int  #: points that must agree
    last_gate: float = 3.5  #: of the steps after these, in robust standard deviations
    min_agreeing_ratio: float = 0.5  #: of all points, those that must agree: more than other robots hide

    def scaled(self, gates: float, noise: float) -> Robust:
        """Return the same with larger gates and noise."""
        point_px, group_px = self.noise
        gates_px = tuple(gates * gate for gate in self.gates_px)
        return replace(self, noise=Noise(noise * point_px, noise * group_px), gates_px=gates_px)

    def weighed(self, residual_px: FloatArray, gate_px: float) -> tuple[FloatArray, Noise]:
        """Weigh residuals (N,).

        Parameters
        ----------
        gate_px : float
            Residuals beyond it have no weight; 0: beyond the last gate.

        Returns
        -------
        weight : (N,) float64
            From 0 to 1.
        noise : Noise
            Where points agree worse than their noise lets expect, their common error is taken to be larger, too.
        """
        inside = np.abs(residual_px) < (gate_px or self.gates_px[-1])
        spread = spread_px(residual_px[inside], self.noise.point_std_px)
        off = np.minimum(np.abs(residual_px) / (gate_px or self.last_gate * spread), 1.0)
        noise = Noise(spread, self.noise.group_std_px * spread / self.noise.point_std_px)
        return np.asarray((1.0 - off**2) ** 2), noise

    def is_supported(self, weight: FloatArray) -> bool:
        """Whether enough points have weight (N,)."""
        return int(np.count_nonzero(weight)) >= max(self.min_points, self.min_agreeing_ratio * len(weight))


@dataclass(frozen=True, slots=True, eq=False)
class FrameEquations:
    """What a frame's points tell: of the camera's parameters, G numbers, then of the frame's own unknowns, F."""

    information: FloatArray  #: (G + F, G + F) float64
    gradient: FloatArray  #: (G + F,) float64: of the log-likelihood, where the points were linearised
    #: (F,), (F,) float64: precision of the frame's own unknowns under their prior, and its gradient there
    own: FloatArray
    own_gradient: FloatArray

    def reduced(self) -> tuple[FloatArray, FloatArray]:
        """Leave out the frame's own unknowns: information (G, G) on the camera's parameters, and gradient (G,)."""
        size = len(self.gradient) - len(self.own)
        cross = self.information[:size, size:]
        solved = self._own_solved(np.column_stack([cross.T, self.gradient[size:] + self.own_gradient]))
        information = self.information[:size, :size] - cross @ solved[:, :-1]
        return (information + information.T) / 2, self.gradient[:size] - cross @ solved[:, -1]

    def own_step(self, step: FloatArray) -> FloatArray:
        """Return the best step (F,) of the frame's own unknowns with one (G,) of the camera's parameters."""
        size = len(step)
        right = self.gradient[size:] + self.own_gradient - self.information[size:, :size] @ step
        return self._own_solved(right)

    def scores(self, points: Residuals, weight: FloatArray, noise: Noise) -> FloatArray:
        """Return the gradient (S, G) by each group of the points (N,), the frame's own unknowns left out."""
        size = points.by_camera.shape[1]
        rows = points.by_camera - points.by_frame @ self._own_solved(self.information[size:, :size])
        _, member = np.unique(points.group, return_inverse=True)
        scores = np.zeros((int(member.max()) + 1, size))
        np.add.at(scores, member, -rows * (weight * points.residual_px / noise.point_std_px**2)[:, None])
        return scores

    def _own_solved(self, right: FloatArray) -> FloatArray:
        size = len(self.gradient) - len(self.own)
        inner = self.information[size:, size:] + np.diag(self.own)
        return solve(inner, right)


def solve(system: FloatArray, right: FloatArray) -> FloatArray:
    """Return the solution of linear equations, as `numpy.linalg.solve` does."""
    return np.asarray(np.linalg.solve(system, right), dtype=np.float64)


def frame_equations(
    points: Residuals, weight: FloatArray, noise: Noise, own: FloatArray, own_gradient: FloatArray
) -> FrameEquations:
    """Return the normal equations of weighted residuals.

    The covariance of a group is a diagonal one of its points plus that of an offset common to them, of rank one. It is
    inverted by the formula of Sherman and Morrison.

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
    """Covariance (G, G) of parameters by independent groups of points that err more than their noise.

    Parameters
    ----------
    information : (G, G) float64
        Of all points and the prior.
    scores : (S, G) float64
        Gradient of the log-likelihood by each group, at the estimate.
    """
    covariance = np.linalg.inv(information)
    moved = scores @ covariance
    return np.asarray(covariance + moved.T @ moved, dtype=np.float64)
