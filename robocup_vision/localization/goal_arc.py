"""The arc of cameras that see a goal nearly alike, and how likely each of them is.

A goal far off says how far away the camera is, but hardly how obliquely it looks: its picture stays the same to a
fraction of a pixel while the camera swings about the goal, from one branch of a plane's picture to the other. No
covariance at one point tells that; a fit at each heading does, for the heading turns as the camera swings.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from robocup_vision.geometry import FloatArray
from robocup_vision.localization.goal_edges import EdgeSamples
from robocup_vision.localization.goal_fit import GoalModel, covariance_of, fit
from robocup_vision.localization.goal_geometry import HEADING, X, Y

# of the cost, in chi-square, up to which the arc is followed
_RISE = 12.0
_FARTHEST_RAD = 1.2
# from one camera to the next: of what the best fit leaves open, then ever wider, up to a place's own lines' distance
_STEP_STDS, _GROWTH, _WIDEST_M = 0.5, 1.2, 0.25
_SCALES = np.full(4, 0.3)


@dataclass(frozen=True, eq=False)
class GoalArc:
    """Cameras along the arc, in order of their headings.

    Parameters
    ----------
    unknowns : (K, 8) float64
        See goal_geometry.
    covariance : (K, 8, 8) float64
        Of the unknowns at each heading.
    cost : (K,) float64
        How much worse each is than the best, in chi-square.
    """

    unknowns: FloatArray
    covariance: FloatArray
    cost: FloatArray

    @property
    def share(self) -> FloatArray:
        """(K,) float64, sum 1: how likely each is, by its cost and the stretch of arc that it stands for."""
        heading = self.unknowns[:, HEADING]
        likely = np.exp(-self.cost / 2) * (np.gradient(heading) if len(heading) > 1 else 1.0)
        return np.asarray(likely / likely.sum())

    def covariance_about(self, p: FloatArray) -> FloatArray:
        """Mean square deviation (8, 8) of all cameras on the arc from one, each as likely as its cost lets it be."""
        off = self.unknowns - p
        share = self.share
        return np.asarray(np.einsum("k,kij->ij", share, self.covariance) + np.einsum("k,ki,kj->ij", share, off, off))


def follow_arc(model: GoalModel, samples: EdgeSamples, start: FloatArray, std_m: float) -> GoalArc:
    """Fit a goal's samples at headings to both sides of the best fit's, as far as they bear it.

    Parameters
    ----------
    model : GoalModel
        Camera, goal and priors.
    samples : EdgeSamples
        Of the goal.
    start : (8,) float64
        The best fit's unknowns.
    std_m : float
        How far along the arc its place is open, one standard deviation by the covariance at that place.
    """
    weight = model.weight.copy()
    weight[HEADING] = np.inf
    held = replace(model, weight=weight)
    line = model.shape.line_x_m
    distance = max(math.hypot(line - start[X], start[Y]), 0.1)
    p, cost, information = fit(held, samples, start, _SCALES)
    least = cost
    sides: list[list[tuple[FloatArray, FloatArray, float]]] = []
    middle = (p, covariance_of(held, information), cost)
    for sign in (-1.0, 1.0):
        side = []
        p, step, swung = middle[0], _STEP_STDS * std_m, 0.0
        while True:
            step = min(_WIDEST_M, step)
            turn = sign * step / distance
            swung += abs(turn)
            c, s = math.cos(turn), math.sin(turn)
            dx, dy = p[X] - line, p[Y]
            moved = p.copy()
            moved[X], moved[Y], moved[HEADING] = line + c * dx - s * dy, s * dx + c * dy, p[HEADING] + turn
            p, cost, information = fit(held, samples, moved, _SCALES)
            if not math.isfinite(cost) or cost > least + _RISE or p[X] > line or swung > _FARTHEST_RAD:
                break
            least = min(least, cost)
            side.append((p, covariance_of(held, information), cost))
            step *= _GROWTH
        sides.append(side)
    points = [*sides[0][::-1], middle, *sides[1]]
    costs = np.array([cost for *_, cost in points])
    return GoalArc(
        np.array([p for p, *_ in points]), np.array([covariance for _, covariance, _ in points]), costs - costs.min()
    )
