"""Search along the arc of a goal for the camera whose drawn lines agree best with the picture."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import Float32Array, FloatArray, Int64Array
from robocup_vision.compiling.loops import compiled, variable
from robocup_vision.kernels.algebra.copies import copy_vector
from robocup_vision.kernels.goal.fit import FitPriors, FitSamples, fit_goal
from robocup_vision.kernels.goal.lines.arc import turn_camera
from robocup_vision.kernels.goal.picture import GoalScene
from robocup_vision.kernels.lines.drawing import LinePen
from robocup_vision.kernels.lines.drawn_light import LitCarpet, compare_drawing

_PLACE = 3  # a turn, and how far off in two directions


class DrawnPicture(NamedTuple):
    """What drawings are compared with.

    Parameters
    ----------
    carpet : LitCarpet
        The picture.
    pen : LinePen
        The lines.
    first_row : int
        Of the image, that the picture begins with.
    drawing : (H + 2 MARGIN, W + 2 MARGIN) float32
        Working memory, zero before and after.
    light_square : float
        Sum of the squared light.
    pixels : float
        So many independent ones it has.
    """

    carpet: LitCarpet
    pen: LinePen
    first_row: int
    drawing: Float32Array
    light_square: float
    pixels: float


class ArcFit(NamedTuple):
    """The goal's samples at one heading.

    Parameters
    ----------
    scene, samples, priors
        See `fit_goal`; the priors hold the heading.
    scales : (K,) float64
        See `fit_goal`.
    start : (8,) float64
        The camera whose heading is turned.
    loosest : (2, 8) float64
        What one standard deviation is in the directions that the samples determine least.
    """

    scene: GoalScene
    samples: FitSamples
    priors: FitPriors
    scales: FloatArray
    start: FloatArray
    loosest: FloatArray


class _Tried(NamedTuple):
    """Places tried (N, 3) and their values (N,); turns fitted (M,), and the cameras (M, 8) and costs (M,) there."""

    places: FloatArray
    values: FloatArray
    turns: FloatArray
    cameras: FloatArray
    costs: FloatArray
    counts: Int64Array


@compiled
def drawn_likelihood(picture: DrawnPicture, view: FloatArray, p: FloatArray) -> float:
    """Logarithm of how much likelier the carpet's light is with a camera's (8,) lines than without any."""
    own, both = compare_drawing(picture.carpet, picture.pen, view, p, picture.first_row, picture.drawing)
    if both <= 0.0 or own <= 0.0:
        return 0.0
    return -0.5 * picture.pixels * math.log(max(1.0 - both * both / (own * picture.light_square), 1e-9))


@compiled(inline="always")
def _fit_at(fit: ArcFit, turn: float, tried: _Tried) -> int:
    """Index of the fit at a turn, made where there is none."""
    count = int(tried.counts[1])
    for n in range(count):
        if tried.turns[n] == turn:
            return n
    p, information = tried.cameras[count], np.empty((8, 8))
    turn_camera(fit.scene.shape[0], fit.start, turn, p)
    tried.turns[count] = turn
    tried.costs[count] = fit_goal(fit.scene, fit.samples, fit.priors, fit.scales, p, information)
    tried.counts[1] += 1
    return int(count)


@compiled(inline="always")
def _value_at(picture: DrawnPicture, fit: ArcFit, place: FloatArray, tried: _Tried) -> float:
    """How likely the camera at a place is, as a logarithm; minus infinity where the samples determine none."""
    count = int(tried.counts[0])
    for n in range(count):
        same = tried.places[n]
        if same[0] == place[0] and same[1] == place[1] and same[2] == place[2]:
            return float(tried.values[n])
    at = _fit_at(fit, place[0], tried)
    value = -np.inf
    if not math.isinf(tried.costs[at]):
        p = np.empty(8)
        for i in range(8):
            p[i] = tried.cameras[at, i] + place[1] * fit.loosest[0, i] + place[2] * fit.loosest[1, i]
        cost = tried.costs[at] + (place[1] * place[1] + place[2] * place[2])
        value = drawn_likelihood(picture, fit.scene.camera, p) - cost / 2.0
    copy_vector(place, tried.places[count])
    tried.values[count] = value
    tried.counts[0] += 1
    return value


@compiled
def settle_drawing(
    picture: DrawnPicture, fit: ArcFit, axes: FloatArray, steps: int, halvings: int, best: FloatArray
) -> float:
    """Find the place on an arc at which the lines drawn agree best: on a grid, then axis by axis in halved steps.

    Parameters
    ----------
    picture, fit : DrawnPicture, ArcFit
        What is compared.
    axes : (3,) float64
        First steps: a turn, radians, and in directions that the samples determine least, standard deviations; 0: not
        searched.
    steps : int
        To either side on the grid.
    halvings : int
        How often steps are halved.
    best : (3,) float64
        Result: the place.

    Returns
    -------
    float
        Its value: the logarithm of its likelihood.
    """
    searched = variable(1)
    while searched < _PLACE and axes[searched] > 0.0:
        searched += 1
    ways = 2 * steps + 1
    room = ways * ways + 2 * halvings * (searched + 1) + 1
    tried = _Tried(
        np.empty((room, _PLACE)),
        np.empty(room),
        np.empty(room),
        np.empty((room, 8)),
        np.empty(room),
        np.zeros(2, np.int64),
    )
    place, step = np.zeros(_PLACE), axes.copy()
    greatest = -np.inf
    best[:] = 0.0
    last = searched - 1
    for k in range(-steps, steps + 1):
        # the last direction, where any is searched, at every other step
        for m in range(-steps + 1 if last else 0, steps + 1 if last else 1, 2):
            place[:] = 0.0
            place[0] = k * step[0]
            if last:
                place[last] = m * step[last]
            value = _value_at(picture, fit, place, tried)
            if value > greatest:
                greatest = value
                copy_vector(place, best)
    for _ in range(halvings):
        for i in range(_PLACE):
            step[i] *= 0.5
        for turn in range(searched + 1 if last else 1):
            axis = turn % searched
            middle = best[axis]
            copy_vector(best, place)
            place[axis] = middle - step[axis]
            before = _value_at(picture, fit, place, tried)
            place[axis] = middle + step[axis]
            after = _value_at(picture, fit, place, tried)
            # of equal ones the first
            if before >= greatest and before >= after:
                greatest, best[axis] = before, middle - step[axis]
            elif after > greatest:
                greatest, best[axis] = after, middle + step[axis]
    return greatest
