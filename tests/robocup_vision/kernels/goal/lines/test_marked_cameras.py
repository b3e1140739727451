"""Cameras fitted to a goal and marks, many at once, against one after the other in plain NumPy."""

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.kernels.goal.fit import FitLoss
from robocup_vision.kernels.goal.lines.marked_cameras import (
    MarkReach,
    MarkWorth,
    SeenMarks,
    choose_marks,
    due_marks,
    fit_marked,
    gather_marks,
    mark_evidence,
)
from robocup_vision.kernels.goal.lines.marks import MarkLimits, MarkPlaces, line_marks, mark_stds
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
    search = GoalSearch(FIELD, CONDITION.camera)
    candidate = search.candidates(search.picture(sample.frame))[0][0]
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


def test_marks_due_of_many_cameras_follow_each_other():
    lines = LineMarks(LineMap(FIELD), CONDITION.camera, _MARKS)
    rng = np.random.default_rng(6)
    along = np.tile([1.0, 0.0], (len(lines.points), 1))
    view, size, limits = np.array([190.0, 190.0, 103.5, 79.5]), (208, 160), MarkLimits(0.025, 6.0, 0.15, 2.5)
    cameras = rng.uniform(-0.1, 0.1, (3, 8)) + np.array([-1.0, 0, 0, -0.1, 0, 0.3, 0, 0])
    covariances = np.array([scale * np.diag([1e-3, 1e-3, 1e-4, 1e-4, 1e-4, 0, 0, 0]) for scale in (0.1, 1, 9)])
    room = 3 * len(lines.points)
    places = MarkPlaces(np.empty((room, 2)), np.empty((room, 2)), np.empty((room, 2)), np.empty(room))
    reach, bounds = np.empty(room), np.empty(4, np.int64)
    count = due_marks(lines.points, along, view, cameras, covariances, size, limits, FAR, places, reach, bounds)
    assert (bounds[0], bounds[-1]) == (0, count)
    for k in range(3):
        single = MarkPlaces(*(np.empty_like(part[: len(lines.points)]) for part in places))
        n = line_marks(lines.points, along, view, cameras[k], size, limits, single)
        part = slice(bounds[k], bounds[k + 1])
        for found, expected in zip(places, single, strict=True):
            np.testing.assert_array_equal(found[part], expected[:n])
        std = np.empty(n)
        mark_stds(single.marks[:n], single.normals[:n], view, cameras[k], covariances[k], std)
        np.testing.assert_allclose(reach[part], np.minimum(3.0 * std + 1.5, 8.0))


def test_marks_that_are_bright_for_their_width_are_gathered_and_weighed():
    rng = np.random.default_rng(9)
    count = 40
    widths, contrast = rng.uniform(0.2, 4.0, count), rng.uniform(1, 30, count)
    contrast[rng.random(count) < 0.3] = np.nan
    places = [rng.normal(size=(count, 2)) for _ in range(3)]
    seen = SeenMarks(np.array([0, 5, count]), *places, widths, rng.uniform(1.5, 8, count), contrast.copy())
    is_seen = np.empty(count - 5, bool)
    chosen = choose_marks(seen.contrast[5:], widths[5:], WORTH.contrast_width_px, WORTH.min_contrast, is_seen)
    bright = contrast[5:] / np.minimum(widths[5:], WORTH.contrast_width_px)
    expected = bright > WORTH.min_contrast * np.nanmedian(bright)
    np.testing.assert_array_equal(is_seen, expected)
    assert chosen == np.count_nonzero(expected)

    gathered, sigma = [np.empty((chosen, 2)) for _ in range(3)], np.empty(chosen)
    marks, uv, directions = gathered
    gather_marks(seen, 5, is_seen, WORTH, marks, uv, directions, sigma)
    for found, of_all in ((marks, seen.marks), (uv, seen.uv), (directions, seen.directions)):
        np.testing.assert_array_equal(found, of_all[5:][expected])
    wide = widths[5:][expected]
    blurred = WORTH.sample_error_px * np.maximum(1.0, WORTH.sharp_width_px / wide)
    np.testing.assert_allclose(
        sigma, np.sqrt(blurred**2 + (WORTH.paint_part * wide) ** 2 + chosen * WORTH.line_error_px**2)
    )

    residual, reach = rng.normal(0, 0.5, chosen), seen.reach[5:]
    due = WORTH.seen_ratio * np.minimum(1.0, widths[5:] / WORTH.full_width_px)
    density = np.exp(-0.5 * (residual / WORTH.spread_px) ** 2) / (WORTH.spread_px * np.sqrt(2 * np.pi))
    ratio = density / (WORTH.clutter_ratio / (2 * reach[expected]))
    there = np.log1p(due[expected] * (ratio - 1.0)).sum() + np.log1p(-due[~expected]).sum()
    assert mark_evidence(residual, widths[5:], reach, is_seen, WORTH) == pytest.approx(there)


def test_where_no_mark_is_seen_none_is_chosen():
    is_seen = np.ones(3, bool)
    assert choose_marks(np.full(3, np.nan), np.ones(3), 0.0, WORTH.min_contrast, is_seen) == 0
    assert not is_seen.any()
