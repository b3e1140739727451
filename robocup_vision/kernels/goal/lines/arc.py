"""Cameras on the arc that sees a far goal nearly alike: one fit at each heading, from the best one to both sides."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra import cholesky
from robocup_vision.kernels.algebra.copies import copy_matrix, copy_vector
from robocup_vision.kernels.goal.fit import FitPriors, FitSamples, fit_goal
from robocup_vision.kernels.goal.picture import GoalScene


class ArcLimits(NamedTuple):
    """How far and how finely an arc is followed.

    Parameters
    ----------
    max_rise : float
        Of the cost, chi-square, up to which it is followed: beyond, a camera has no weight left.
    max_turn_rad : float
        About the goal's middle: farther round the goal is seen too obliquely.
    first_step : float
        From the best camera to the next, in standard deviations of the place: fine where the cost is lowest.
    growth : float
        Of each step over the one before: an arc that goes on is wide and smooth.
    max_step_m : float
        Widest step: a place's own lines must not be stepped over.
    """

    max_rise: float = 12.0
    max_turn_rad: float = 1.2
    first_step: float = 0.5
    growth: float = 1.2
    max_step_m: float = 0.25


class ArcCameras(NamedTuple):
    """Cameras on an arc.

    Parameters
    ----------
    unknowns : (K, 8) float64
        In the order of goal/geometry.py.
    covariance : (K, 8, 8) float64
        Of the unknowns at each heading.
    cost : (K,) float64
        Of each fit.
    """

    unknowns: FloatArray
    covariance: FloatArray
    cost: FloatArray


@compiled
def invert_information(information: FloatArray, weight: FloatArray, covariance: FloatArray) -> bool:
    """Invert an information matrix (8, 8); unknowns of infinite weight have no variance. False: it is not definite."""
    lower = np.empty((8, 8))
    copy_matrix(information, lower)
    if not cholesky.invert(lower, covariance):
        return False
    for i in range(8):
        for j in range(8):
            if math.isinf(weight[i]) or math.isinf(weight[j]):
                covariance[i, j] = 0.0
    return True


@compiled
def turn_camera(line_x_m: float, p: FloatArray, turn_rad: float, turned: FloatArray) -> None:
    """Rotate a camera (8,) about the goal's middle."""
    copy_vector(p, turned)
    c, s = math.cos(turn_rad), math.sin(turn_rad)
    dx, dy = p[0] - line_x_m, p[1]
    turned[0], turned[1], turned[2] = line_x_m + c * dx - s * dy, s * dx + c * dy, p[2] + turn_rad


@compiled
def trace_arc(
    scene: GoalScene,
    samples: FitSamples,
    priors: FitPriors,
    scales: FloatArray,
    start: FloatArray,
    std_m: float,
    limits: ArcLimits,
    cameras: ArcCameras,
) -> tuple[int, int]:
    """Fit a goal's samples at headings to both sides of the best fit's, as far as they allow it.

    Parameters
    ----------
    scene, samples, priors, scales
        See `fit_goal`; the priors hold the heading.
    start : (8,) float64
        The best fit's unknowns.
    std_m : float
        How far along the arc its place is open, one standard deviation.
    limits : ArcLimits
        How far and how finely.
    cameras : ArcCameras
        Results, in order of their headings; the start's is in the middle of the room.

    Returns
    -------
    (int, int)
        Index of the first of them, and of the first one after them; none where the start has no fit.
    """
    line_x_m = scene.shape[0]
    distance = max(math.hypot(line_x_m - start[0], start[1]), 0.1)
    room = cameras.cost.shape[0]
    middle = room // 2
    information = np.empty((8, 8))
    p = cameras.unknowns[middle]
    copy_vector(start, p)
    cost = fit_goal(scene, samples, priors, scales, p, information)
    if math.isinf(cost) or not invert_information(information, priors.weight, cameras.covariance[middle]):
        return middle, middle
    cameras.cost[middle] = cost
    least = cost
    begin, end = middle, middle + 1
    for sign in (-1, 1):
        step, rotated, at = limits.first_step * std_m, 0.0, middle
        while 0 < at < room - 1:
            step = min(limits.max_step_m, step)
            turn = sign * step / distance
            rotated += abs(turn)
            p = cameras.unknowns[at + sign]
            turn_camera(line_x_m, cameras.unknowns[at], turn, p)
            cost = fit_goal(scene, samples, priors, scales, p, information)
            is_past = rotated > limits.max_turn_rad or p[0] > line_x_m
            if is_past or math.isinf(cost) or cost > least + limits.max_rise:
                break
            if not invert_information(information, priors.weight, cameras.covariance[at + sign]):
                break
            at += sign
            least = min(least, cost)
            cameras.cost[at] = cost
            step *= limits.growth
        begin, end = min(begin, at), max(end, at + 1)
    return begin, end
