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
from robocup_vision.kernels.goal.lines.arc import ArcCameras, ArcLimits, trace_arc
from robocup_vision.kernels.goal.lines.settle import ArcFit
from robocup_vision.localization.goal.edges import EdgeSamples
from robocup_vision.localization.goal.fit import GoalFit, GoalModel, covariance_of, fit_samples
from robocup_vision.localization.goal.geometry import HEADING, UNKNOWNS, X, Y

# scale of the robust loss in each iteration, pixels: samples on an arc have small residuals
_SCALES, _CONSTRAINED_SCALES = np.full(4, 0.3), np.full(3, 0.5)
_LIMITS = ArcLimits()
_MAX_CAMERAS = 257  # largest number of an arc: on the largest field it has some 140 steps


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


def at_one_heading(model: GoalModel) -> GoalModel:
    """Return the same model, with the heading fixed where a fit starts."""
    weight = model.weight.copy()
    weight[HEADING] = np.inf
    return replace(model, weight=weight)


def turned(model: GoalModel, unknowns: FloatArray, turn_rad: float) -> FloatArray:
    """Return a camera (8,) rotated about the goal's middle."""
    line = model.shape.line_x_m
    c, s = math.cos(turn_rad), math.sin(turn_rad)
    dx, dy = unknowns[X] - line, unknowns[Y]
    p = unknowns.copy()
    p[X], p[Y], p[HEADING] = line + c * dx - s * dy, s * dx + c * dy, unknowns[HEADING] + turn_rad
    return p


def follow_arc(model: GoalModel, samples: EdgeSamples, start: FloatArray, std_m: float) -> GoalArc:
    """Fit a goal's samples at headings to both sides of the best fit's unknowns (8,), as far as they allow it.

    `std_m` is the standard deviation of the place along the arc, by the covariance at the best fit.
    """
    cameras = ArcCameras(
        np.empty((_MAX_CAMERAS, UNKNOWNS)), np.empty((_MAX_CAMERAS, UNKNOWNS, UNKNOWNS)), np.empty(_MAX_CAMERAS)
    )
    priors = at_one_heading(model).priors
    begin, end = trace_arc(model.scene, samples.for_fit, priors, _SCALES, start, std_m, _LIMITS, cameras)
    unknowns, covariance, cost = (part[begin:end] for part in cameras)
    return GoalArc(unknowns, covariance, cost - cost.min(initial=math.inf))


def open_arc(model: GoalModel, found: GoalFit, covariance: FloatArray, certain_m: float) -> GoalArc | None:
    """Follow the arc of a goal whose fit, with a covariance (8, 8), leaves the position less certain than `certain_m`.

    None where the position is certain.
    """
    std_m = math.sqrt(float(np.linalg.eigvalsh(covariance[:2, :2])[-1]))
    return follow_arc(model, found.samples, found.unknowns, std_m) if std_m > certain_m else None


class ConstrainedArc:
    """Cameras near the best fit (8,) at given headings, displaced in the directions that the samples determine least.

    A place (1 + K,) is a turn of the heading, radians, and displacements in K such directions, standard deviations.
    """

    def __init__(self, model: GoalModel, samples: FitSamples, start: FloatArray) -> None:
        self._constrained = at_one_heading(model)
        self._samples, self._start = samples, start
        self._fits: dict[float, tuple[FloatArray, float, FloatArray] | None] = {}
        first = self._fit(0.0)
        covariance = np.zeros((UNKNOWNS, UNKNOWNS)) if first is None else covariance_of(self._constrained, first[2])
        variance, vectors = np.linalg.eigh(covariance)
        # metres and radians alike: over a few metres they move the picture alike
        self._loosest = (vectors * np.sqrt(np.maximum(variance, 0.0))).T[::-1]

    @property
    def for_search(self) -> ArcFit:
        """The arc as `kernels.goal.lines.settle` takes it."""
        return ArcFit(
            self._constrained.scene,
            self._samples,
            self._constrained.priors,
            _CONSTRAINED_SCALES,
            self._start,
            np.ascontiguousarray(self._loosest[:2]),
        )

    def camera(self, place: FloatArray) -> tuple[FloatArray, float] | None:
        """Camera (8,) at a place and its cost, chi-square; None where the samples determine none."""
        found = self._fit(float(place[0]))
        if found is None:
            return None
        off = place[1:]
        return found[0] + off @ self._loosest[: len(off)], found[1] + float(off @ off)

    def rest(self, place: FloatArray) -> FloatArray:
        """Covariance (8, 8) at a place, less that along its directions."""
        found = self._fit(float(place[0]))
        if found is None:
            return np.zeros((UNKNOWNS, UNKNOWNS))
        if len(place) == 1:
            return covariance_of(self._constrained, found[2])
        tighter = self._loosest[len(place) - 1 :]
        return np.asarray(tighter.T @ tighter, np.float64)

    def _fit(self, turn: float) -> tuple[FloatArray, float, FloatArray] | None:
        if turn not in self._fits:
            start = turned(self._constrained, self._start, turn)
            p, cost, information = fit_samples(self._constrained, self._samples, start, _CONSTRAINED_SCALES)
            self._fits[turn] = (p, cost, information) if math.isfinite(cost) else None
        return self._fits[turn]
