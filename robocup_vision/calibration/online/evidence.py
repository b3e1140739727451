"""Evidence of one frame on a camera: residuals in pixels, and their information without the frame's own unknowns.

The robot's pose, and the sway of a body that carries the camera, are different unknowns in every frame. They are
marginalised (Schur complement), so that residuals which they could explain do not change the camera.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray, Int64Array

# precision of a frame's pose under its prior, 1/m^2 and 1/rad^2: next to nothing is known
POSE_PRECISION = 1.0
# half of the residuals of a normal distribution lie within 0.674 standard deviations
_MEDIAN_TO_STD = 1.483


class NoiseSettings(NamedTuple):
    """Noise of measured points."""

    point_std_px: float  #: standard deviation of a point alone, at least
    #: that of the offset which all points of a group share: an edge's paint and tape, a sector's lens or mirror
    group_std_px: float


@dataclass(frozen=True, slots=True, eq=False)
class Residuals:
    """Residuals of one frame's points, with their derivatives."""

    residual_px: FloatArray  #: (N,) float64: expected less measured, along the normal of the edge
    by_camera: FloatArray  #: (N, G) float64: derivatives by the camera's parameters
    by_frame: FloatArray  #: (N, F) float64: derivatives by the frame's own unknowns
    group: Int64Array  #: (N,) int64: points of one number have a common error


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Log-likelihood of the camera's parameters, as a Gaussian in information form, by one frame."""

    linearised_at: FloatArray  #: (G,) float64: where it was linearised
    information: FloatArray  #: (G, G) float64: may be singular
    gradient: FloatArray  #: (G,) float64: of the log-likelihood there


def spread_px(residual_px: FloatArray, min_px: float) -> float:
    """Robust standard deviation of residuals, at least `min_px`."""
    if not len(residual_px):
        return min_px
    return max(min_px, _MEDIAN_TO_STD * float(np.median(np.abs(residual_px))))


def tukey_weights(residual_px: FloatArray, gate_px: float) -> FloatArray:
    """Weights (N,) in [0, 1] of residuals: 0 beyond the gate."""
    inside = 1.0 - np.minimum(np.abs(residual_px) / gate_px, 1.0) ** 2
    return np.asarray(inside * inside)


def normal_equations(points: Residuals, weight: FloatArray, noise: NoiseSettings) -> tuple[FloatArray, FloatArray]:
    """Information (G + F, G + F) and gradient (G + F,) of weighted residuals, the camera's parameters first.

    The covariance of a group is a diagonal one of its points plus that of an offset common to them, of rank one. It is
    inverted by the formula of Sherman and Morrison.
    """
    rows = np.hstack([points.by_camera, points.by_frame, points.residual_px[:, None]])
    precision = weight / noise.point_std_px**2
    weighted = rows * precision[:, None]
    total = rows.T @ weighted
    if noise.group_std_px > 0 and len(rows):
        _, member = np.unique(points.group, return_inverse=True)
        common = np.zeros((int(member.max()) + 1, rows.shape[1]))
        np.add.at(common, member, weighted)
        amount = np.bincount(member, weights=precision)
        total -= common.T @ (common / (noise.group_std_px**-2 + amount)[:, None])
    return total[:-1, :-1], -total[:-1, -1]


def gauss_newton_step(
    information: FloatArray,
    gradient: FloatArray,
    before: tuple[FloatArray, FloatArray],
    own: tuple[FloatArray, FloatArray],
) -> FloatArray:
    """Step of the camera's parameters and of a frame's own unknowns by points and prior.

    Parameters
    ----------
    before : (G, G), (G,) float64
        Information on the camera's parameters before the frame, and its gradient where the points were linearised.
    own : (F,), (F,) float64
        Precision of the frame's own unknowns under their prior, and its gradient there.

    Returns
    -------
    (G + F,) float64
    """
    size = len(before[0])
    system, right = information.copy(), gradient.copy()
    system[:size, :size] += before[0]
    right[:size] += before[1]
    system[size:, size:] += np.diag(own[0])
    right[size:] += own[1]
    return np.asarray(np.linalg.solve(system, right), dtype=np.float64)


def has_support(agreeing: int, total: int, min_points: int, min_ratio: float) -> bool:
    """Whether enough of a frame's points agree with the field for the frame to be used."""
    return agreeing >= max(min_points, min_ratio * total)


def marginal(
    information: FloatArray, gradient: FloatArray, size: int, own: FloatArray, own_gradient: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Leave out a frame's own unknowns.

    Parameters
    ----------
    size : int
        Number G of the camera's parameters.
    own, own_gradient : (F,) float64
        Precision of the frame's own unknowns under their prior, and its gradient where the points were linearised.

    Returns
    -------
    (G, G), (G,) float64
        Information on the camera's parameters, and gradient.
    """
    inner = information[size:, size:] + np.diag(own)
    return eliminate(
        information[:size, :size], information[:size, size:], inner, gradient[:size], gradient[size:] + own_gradient
    )


def eliminate(
    common: FloatArray, cross: FloatArray, inner: FloatArray, right: FloatArray, inner_right: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Eliminate unknowns from normal equations (Schur complement).

    Parameters
    ----------
    common, cross, inner : (G, G), (G, F), (F, F) float64
        Parts of the information matrix: of the unknowns that stay, between both, of those that are eliminated.
    right, inner_right : (G,), (F,) float64
        Gradients of both.

    Returns
    -------
    (G, G), (G,) float64
        Information on the unknowns that stay, and gradient.
    """
    solved = np.linalg.solve(inner, np.column_stack([cross.T, inner_right]))
    reduced = common - cross @ solved[:, :-1]
    return (reduced + reduced.T) / 2, right - cross @ solved[:, -1]


def known(mask: npt.NDArray[np.bool_], points: Residuals) -> Residuals:
    """Return the points where a mask is true."""
    return Residuals(points.residual_px[mask], points.by_camera[mask], points.by_frame[mask], points.group[mask])
