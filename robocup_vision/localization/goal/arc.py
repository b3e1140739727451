"""The arc of cameras whose pictures of a goal are nearly alike, and the probability of each.

A goal far off fixes the distance of the camera, but hardly its angle to the goal: its picture stays the same to a
fraction of a pixel while the camera rotates about the goal, from one branch of a plane's picture to the other. No
covariance at one point describes that; a fit at each heading does, for the heading turns with the camera.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.kernels.goal.fit import FitSamples
from robocup_vision.localization.goal.fit import GoalFit, GoalModel, covariance_of, fit_samples
from robocup_vision.localization.goal.geometry import HEADING, X, Y

# scale of the robust loss in each iteration, pixels: samples on an arc have small residuals
_SCALES = np.full(4, 0.3)
# where an arc ends: beyond this rise of chi-square a camera has no weight left, and farther round the goal it is seen
# too obliquely
_MAX_RISE, _MAX_TURN_RAD = 12.0, 1.2
# steps along it: the first one in standard deviations of the place, each longer than the one before by a factor, and
# none so long that it steps over a place's own lines
_FIRST_STEP, _GROWTH, _MAX_STEP_M = 0.5, 1.2, 0.25


@dataclass(frozen=True, eq=False)
class GoalArc:
    """Cameras along the arc, in order of their headings."""

    unknowns: FloatArray  #: (K, 8) float64: in the order of goal/geometry.py
    covariance: FloatArray  #: (K, 8, 8) float64: of the unknowns at each heading
    cost: FloatArray  #: (K,) float64: chi-square above that of the best

    @property
    def probability(self) -> FloatArray:
        """(K,) float64, sum 1: of each camera, by its cost and the length of arc that it represents."""
        heading = self.unknowns[:, HEADING]
        likely = np.exp(-self.cost / 2) * (np.gradient(heading) if len(heading) > 1 else 1.0)
        return np.asarray(likely / likely.sum())

    def covariance_about(self, p: FloatArray) -> FloatArray:
        """Mean square deviation (8, 8) of all cameras on the arc from one, each weighted by its probability."""
        return spread_about(p, self.unknowns, self.covariance, self.probability)


def spread_about(p: FloatArray, unknowns: FloatArray, covariance: FloatArray, probability: FloatArray) -> FloatArray:
    """Mean square deviation (8, 8) from one camera (8,) of some (K, 8), of which one is right: each so probable."""
    off = unknowns - p
    return np.asarray(np.einsum("k,kij->ij", probability, covariance) + np.einsum("k,ki,kj->ij", probability, off, off))


def turned(model: GoalModel, unknowns: FloatArray, turn_rad: float) -> FloatArray:
    """Return a camera (8,) rotated about the goal's middle."""
    line = model.shape.line_x_m
    c, s = math.cos(turn_rad), math.sin(turn_rad)
    dx, dy = unknowns[X] - line, unknowns[Y]
    p = unknowns.copy()
    p[X], p[Y], p[HEADING] = line + c * dx - s * dy, s * dx + c * dy, unknowns[HEADING] + turn_rad
    return p


class FitsByHeading:
    """The best fit (8,) of a goal's samples at each heading."""

    def __init__(self, model: GoalModel, samples: FitSamples, start: FloatArray) -> None:
        weight = model.weight.copy()
        weight[HEADING] = np.inf
        self._model, self._samples, self._start = replace(model, weight=weight), samples, start
        self._fits: dict[float, tuple[FloatArray, float, FloatArray] | None] = {}

    def at(self, turn: float, start: FloatArray | None = None) -> tuple[FloatArray, float, FloatArray] | None:
        """Unknowns, chi-square and covariance at a heading turned by so much; None where the samples determine none.

        `start` is a camera at that heading, by default the first one rotated about the goal.
        """
        if turn not in self._fits:
            start = turned(self._model, self._start, turn) if start is None else start
            p, cost, information = fit_samples(self._model, self._samples, start, _SCALES)
            self._fits[turn] = (p, cost, covariance_of(self._model, information)) if math.isfinite(cost) else None
        return self._fits[turn]


def follow_arc(model: GoalModel, samples: FitSamples, start: FloatArray, std_m: float) -> GoalArc | None:
    """Fit a goal's samples at headings to both sides of the best fit's unknowns (8,), as far as they allow it.

    `std_m` is the standard deviation of the place along the arc, by the covariance at the best fit. None where the
    samples determine no camera.
    """
    fits, line_x_m = FitsByHeading(model, samples, start), model.shape.line_x_m
    middle = fits.at(0.0)
    if middle is None:
        return None
    distance_m = max(math.hypot(line_x_m - start[X], start[Y]), 0.1)
    least, ways = middle[1], []
    for sign in (-1, 1):
        way, step_m, turn = [middle], _FIRST_STEP * std_m, 0.0
        while abs(turn) <= _MAX_TURN_RAD:
            step_m = min(_MAX_STEP_M, step_m)
            before = turned(model, way[-1][0], sign * step_m / distance_m)
            turn += sign * step_m / distance_m
            found = fits.at(turn, before)
            if found is None or found[0][X] > line_x_m or found[1] > least + _MAX_RISE:
                break
            way.append(found)
            least = min(least, found[1])
            step_m *= _GROWTH
        ways.append(way)
    cameras = [*reversed(ways[0][1:]), *ways[1]]
    unknowns, cost, covariance = (np.array(part) for part in zip(*cameras, strict=True))
    return GoalArc(unknowns, covariance, cost - least)


def open_arc(model: GoalModel, found: GoalFit, certain_m: float) -> GoalArc | None:
    """Follow the arc of a goal whose fit leaves the place less certain than `certain_m`; None where it is certain."""
    covariance = covariance_of(model, found.information)
    std_m = math.sqrt(float(np.linalg.eigvalsh(covariance[:2, :2])[-1]))
    return follow_arc(model, found.samples.for_fit, found.unknowns, std_m) if std_m > certain_m else None
