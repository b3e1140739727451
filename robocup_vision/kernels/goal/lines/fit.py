"""The fit of a camera to a goal and to points seen on lines, associated with their nearest lines anew at each step."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.pinhole import camera_axes, ideal_pixel, in_camera
from robocup_vision.kernels.goal.fit import FitLoss, FitPriors, FitSamples, fit_goal
from robocup_vision.kernels.goal.picture import GoalScene
from robocup_vision.kernels.lines.lines import ANYWHERE2, nearest_line

# a line's direction in the picture is taken over this length; rays less steep meet no floor of the field
_AHEAD_M, _MIN_FALL = 0.005, 1e-3


class LinePlaces(NamedTuple):
    """Where lines were seen, and the field's lines.

    Parameters
    ----------
    pixels : (N, 2) float64
        Ideal pixels.
    sigma : (N,) float64
        Noise of each, pixels.
    lines, arcs : (L, 4), (A, 5) float64
        Of the field, see `Field`.
    """

    pixels: FloatArray
    sigma: FloatArray
    lines: FloatArray
    arcs: FloatArray


class AssociatedMarks(NamedTuple):
    """Room for the points of `LinePlaces` that show the floor, as marks of `FitSamples`.

    Parameters
    ----------
    point : (N,) int64
        Which point each is.
    mark_m, mark_uv, mark_direction : (N, 2) float64
        See `FitSamples`.
    """

    point: Int64Array
    mark_m: FloatArray
    mark_uv: FloatArray
    mark_direction: FloatArray


@compiled
def associate_points(places: LinePlaces, view: FloatArray, p: FloatArray, marks: AssociatedMarks) -> int:
    """Associate points with the nearest line each; returns how many show the floor.

    Parameters
    ----------
    places : LinePlaces
        Points and lines.
    view : (4,) float64
        Focal lengths and centre, pixels.
    p : (8,) float64
        The unknowns.
    marks : AssociatedMarks
        Results.
    """
    axes, scale = camera_axes(p[2], p[3], p[4]), math.exp(p[6])
    (r00, r01, r02), (r10, r11, r12), (r20, r21, r22) = axes
    fu, fv = view[0] * scale, view[1] * scale
    count = 0
    for n in range(places.pixels.shape[0]):
        left, up = (view[2] - places.pixels[n, 0]) / fu, (view[3] - places.pixels[n, 1]) / fv
        fall = r20 + left * r21 + up * r22
        if not fall < -_MIN_FALL:
            continue
        reach = -p[5] / fall
        x, y = p[0] + reach * (r00 + left * r01 + up * r02), p[1] + reach * (r10 + left * r11 + up * r12)
        distance, nx, ny, _ = nearest_line(x, y, places.lines, places.arcs, ANYWHERE2)
        mx, my = x - nx * distance - p[0], y - ny * distance - p[1]
        depth, to_left, to_up = in_camera(axes, mx, my, -p[5])
        ahead, ahead_left, ahead_up = in_camera(axes, mx - ny * _AHEAD_M, my + nx * _AHEAD_M, -p[5])
        if depth <= 1e-6 or ahead <= 1e-6:
            continue
        u, v = ideal_pixel(fu, fv, view[2], view[3], depth, to_left, to_up)
        ahead_u, ahead_v = ideal_pixel(fu, fv, view[2], view[3], ahead, ahead_left, ahead_up)
        length = math.hypot(ahead_u - u, ahead_v - v)
        if not length > 0.0:
            continue
        marks.point[count] = n
        marks.mark_m[count, 0], marks.mark_m[count, 1] = mx + p[0], my + p[1]
        marks.mark_uv[count, 0], marks.mark_uv[count, 1] = places.pixels[n, 0], places.pixels[n, 1]
        marks.mark_direction[count, 0] = (ahead_v - v) / length
        marks.mark_direction[count, 1] = (u - ahead_u) / length
        count += 1
    return count


@compiled
def fit_to_points(
    scene: GoalScene,
    goal: FitSamples,
    places: LinePlaces,
    priors: FitPriors,
    loss: FitLoss,
    marks: AssociatedMarks,
    p: FloatArray,
) -> float:
    """Fit a camera to a goal's samples and to points on lines, one Gauss-Newton step for each association.

    Parameters
    ----------
    scene, goal, places, priors
        What is fitted to what; the goal's samples have no marks.
    loss : FitLoss
        One entry a step.
    marks : AssociatedMarks
        Room.
    p : (8,) float64
        Start, overwritten with the result.

    Returns
    -------
    float
        The last step's cost, see `fit_goal`.
    """
    first, cost = goal.sigma.shape[0], np.inf
    sigma, normal = np.empty(first + places.sigma.shape[0]), np.empty((8, 8))
    for n in range(first):
        sigma[n] = goal.sigma[n]
    for step in range(loss.goal_px.shape[0]):
        count = associate_points(places, scene.camera, p, marks)
        for n in range(count):
            sigma[first + n] = places.sigma[marks.point[n]]
        samples = FitSamples(
            goal.edge,
            goal.uv,
            goal.foot_post,
            goal.foot_at,
            goal.foot_uv,
            goal.foot_direction,
            marks.mark_m[:count],
            marks.mark_uv[:count],
            marks.mark_direction[:count],
            sigma[: first + count],
        )
        once = FitLoss(loss.goal_px[step : step + 1], loss.mark_px[step : step + 1], loss.redescends)
        cost = fit_goal(scene, samples, priors, once, p, normal)
        if math.isinf(cost):
            break
    return cost
