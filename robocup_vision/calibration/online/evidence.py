"""Evidence of one frame about a camera: a fit of its points under the prior of the camera's parameters."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.calibration.least_squares import FrameEquations, Residuals, Robust, frame_equations, solve


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Log-likelihood of the camera's parameters given one frame, as a Gaussian in information form."""

    linearised_at: FloatArray  #: (G,) float64: point of linearisation
    information: FloatArray  #: (G, G) float64: may be singular
    gradient: FloatArray  #: (G,) float64: gradient of the log-likelihood at that point


@dataclass(frozen=True, slots=True, eq=False)
class Belief:
    """Prior of a camera's parameters before a frame."""

    #: (G,), (G, G) float64
    mean: FloatArray
    covariance: FloatArray
    start: FloatArray  #: (G,) float64: parameters with which the frame was located, and start of the fit


def fit_frame(
    points_at: Callable[[FloatArray], Residuals],
    belief: Belief,
    own: FloatArray,
    own_off: FloatArray,
    robust: Robust,
    skew_px: float = 0.0,
) -> FrameEquations | None:
    """Fit a camera's parameters and a frame's nuisance parameters.

    Parameters
    ----------
    points_at : callable
        Returns the frame's points for a step (G + F,) from the start.
    own, own_off : (F,) float64
        Prior precision of the nuisance parameters, and their deviation from the prior's mean at the start.
    skew_px : float
        Standard deviation of an additional error shared by the points of a group.

    Returns
    -------
    FrameEquations or None
        Equations about the start; None if too few points agree.
    """
    size, precision = len(belief.start), np.linalg.inv(belief.covariance)
    step = np.zeros(size + len(own))
    for gate in robust.gates_px:
        equations, _ = _equations(points_at(step), own, own_off + step[size:], robust, gate, skew_px)
        information, gradient = equations.reduced()
        pull = precision @ (belief.mean - belief.start - step[:size])
        of_camera = solve(precision + information, pull + gradient)
        step += np.concatenate([of_camera, equations.own_step(of_camera)])
    equations, is_supported = _equations(points_at(step), own, own_off, robust, 0.0, skew_px)
    if not is_supported:
        return None
    return replace(equations, gradient=equations.gradient + equations.information @ step)


def _equations(
    points: Residuals, own: FloatArray, own_off: FloatArray, robust: Robust, gate_px: float, skew_px: float
) -> tuple[FrameEquations, bool]:
    weight, noise = robust.weighed(points.residual_px, gate_px)
    noise = noise._replace(group_std_px=math.hypot(noise.group_std_px, skew_px))
    return frame_equations(points, weight, noise, own, -own * own_off), robust.is_supported(weight)
