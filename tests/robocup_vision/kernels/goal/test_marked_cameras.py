"""Cameras fitted to a goal and marks, many at once, against one after the other in plain NumPy."""

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.kernels.goal.fit import FitLoss
from robocup_vision.kernels.goal.marked_cameras import MarkReach, MarkWorth, fit_marked
from robocup_vision.kernels.goal.marks import mark_stds
from robocup_vision.localization.goal.arc import turned
from robocup_vision.localization.goal.colored_lines import _MARKS
from robocup_vision.localization.goal.fit import fit, residuals
from robocup_vision.localization.goal.line_marks import LineMarks, with_marks
from robocup_vision.localization.goal.search import GoalSearch
from robocup_vision.localization.lines.line_map import LineMap
from sim2d.rendering.goal.scenes import GOAL_CONDITIONS, paper_places, sample_goal

FIELD = load_field("four_legged_2007")
CONDITION = GOAL_CONDITIONS["mild_glare_208x160"]
FAR = MarkReach(3.0, 1.5, 8.0)
WORTH = MarkWorth(0.4, 1.5, 10, 0.45, 0.5, 0.045, 0.06, 0.8, 0.35, 0.4, 0.2)
SCALES = np.full(4, 1.5)


@pytest.fixture(scope="module")
def goal():
    sample = next(sample_goal(FIELD, CONDITION, 7, 66, places=paper_places(FIELD), indices=[47], supersample=3))
    candidate = GoalSearch(FIELD, CONDITION.camera).candidates(sample.frame)[0][0]
    return sample.frame, candidate.model, candidate.fit


def plain_fit(frame, marks, model, samples, p, covariance):
    """Fit one camera to goal and marks; returns it and the log-likelihood ratio, or None."""
    due = marks.predict(model, p)
    std = np.empty(len(due))
    mark_stds(due.mark_m, due.direction, model.scene.camera, p, covariance, std)
    reach = np.minimum(FAR.stds * std + FAR.more_px, FAR.max_px)
    uv, seen = marks.measure(frame, due, reach)
    if len(uv) < WORTH.min_marks:
        return None
    near = due.take(seen)
    blurred = WORTH.sample_error_px * np.maximum(1.0, WORTH.sharp_width_px / near.width_px)
    common = WORTH.line_error_px**2 * len(uv)
    sigma = np.sqrt(blurred**2 + (WORTH.paint_part * near.width_px) ** 2 + common)
    joined = with_marks(samples, near.mark_m, uv, near.direction, sigma)
    q, cost, _ = fit(model, joined, p, SCALES)
    if not np.isfinite(cost):
        return None
    off = residuals(model, joined, q)[-len(uv) :] / WORTH.spread_px
    likely = WORTH.seen_ratio * np.minimum(1.0, due.width_px / WORTH.full_width_px)
    density = np.exp(-0.5 * off**2) / (WORTH.spread_px * np.sqrt(2 * np.pi))
    clutter = WORTH.clutter_ratio / (2 * reach[seen])
    there = np.log1p(likely[seen] * (density / clutter - 1.0))
    return q, there.sum() + np.log1p(-likely[~seen]).sum()


def test_cameras_fitted_at_once_are_those_fitted_one_by_one(goal):
    frame, model, found = goal
    marks = LineMarks(LineMap(FIELD), CONDITION.camera, _MARKS)
    cameras = np.array([turned(model, found.unknowns, turn) for turn in (-0.6, -0.2, 0.0, 0.05, 3.0)])
    covariances = np.array([scale * np.diag([1e-3, 1e-3, 1e-4, 1e-5, 1e-5, 1e-5, 0, 0]) for scale in (4, 1, 1, 9, 1)])
    seen = marks.look(frame, model, cameras, covariances, FAR)
    fits, evidence = cameras.copy(), np.empty(len(cameras))
    loss = FitLoss(SCALES, SCALES, False)
    fit_marked(model.scene, found.samples.for_fit, model.priors, loss, seen, WORTH, fits, evidence)
    answered = 0
    for k, (p, covariance) in enumerate(zip(cameras, covariances, strict=True)):
        plain = plain_fit(frame, marks, model, found.samples, p, covariance)
        if plain is None:
            assert evidence[k] == -np.inf
        else:
            answered += 1
            np.testing.assert_allclose(fits[k], plain[0], atol=1e-9)
            assert evidence[k] == pytest.approx(plain[1], abs=1e-6)
    assert 2 <= answered < len(cameras)
