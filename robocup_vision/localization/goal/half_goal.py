"""Half a goal, fitted from where the camera is believed to be: one post and the bar, or two posts without it.

Others may stand before the rest of it, and their edges must not pass for the goal's own.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import cv2
import numpy as np

from robocup_vision.arrays import UInt8Array
from robocup_vision.geometry import Pose2
from robocup_vision.localization.goal.edges import Look
from robocup_vision.localization.goal.fit import (
    MIN_EDGE_SHARE,
    MIN_ELEMENT_SHARE,
    GoalFit,
    GoalModel,
    fit,
    refine,
    residuals,
    without_element,
)
from robocup_vision.localization.goal.geometry import BAR_TOP, HEADING, TILT, X, Y
from robocup_vision.localization.goal.search import EDGE_ON_M, Candidate, GoalSearch
from robocup_vision.localization.goal.starts import strip_samples
from robocup_vision.perception.goal_region import Strip

PRIOR_STD_M, PRIOR_STD_RAD = 0.4, 0.15
_MIN_SAMPLES = 6  # of a post or a bar
_MAX_STRIPS = 6
_START_SCALES, _AGAIN_SCALES = np.full(8, 100.0), np.ones(3)
_AROUND = np.ones((3, 3), np.uint8)


def find_half_goal(search: GoalSearch, frame: UInt8Array, prior: Pose2) -> Candidate | None:
    """Fit one post and the bar, or two posts without it, under a prior pose; None where less is in view.

    Parameters
    ----------
    search : GoalSearch
        Field and camera.
    frame : (H, W, 3) uint8
        BGR.
    prior : Pose2
        Known to `PRIOR_STD_M` and `PRIOR_STD_RAD`. It says where to look, and is not in the information of what is
        found: a filter whose belief the prior was does not hear itself.
    """
    best: Candidate | None = None
    for proposal in search.proposals(frame):
        look = proposal.look
        if proposal.model is search.colored_model:
            # what hides the rest of the goal has edges of its own, but no paint inside
            look = replace(look, paint=np.asarray(cv2.dilate(cv2.medianBlur(proposal.paint, 3), _AROUND), np.uint8))
        for side in proposal.sides:
            held = under_prior(proposal.model, prior if side > 0 else prior.half_turn())
            for strip, post in itertools.product(proposal.found[:_MAX_STRIPS], (0, 1)):
                whole = _fit_one_post(search, frame, strip, post, held, look)
                seen = None if whole is None else _by_what_stands(proposal.model, held, whole)
                if seen is None or seen.unknowns[X] > held.shape.line_x_m - EDGE_ON_M:
                    continue
                strain = (seen.unknowns - held.prior)[[X, Y, HEADING]]
                if np.any(np.abs(strain) > 3 * np.array([PRIOR_STD_M, PRIOR_STD_M, PRIOR_STD_RAD])):
                    continue
                if best is None or seen.score > best.fit.score:
                    best = Candidate(seen, (side,), proposal.model, proposal.look, None)
    return best


def _fit_one_post(
    search: GoalSearch, frame: UInt8Array, strip: Strip, post: int, held: GoalModel, look: Look
) -> GoalFit | None:
    samples = strip_samples(search.camera, ((post, strip),))
    start = held.prior.copy()
    # the strip's foot tells the tilt, and where the post stands the heading
    distance = math.hypot(held.shape.line_x_m - start[X], held.shape.post_y_m[post] - start[Y])
    low = strip.foot if math.isfinite(strip.foot) else strip.bottom
    start[TILT] = -math.atan(search.camera.height_m / distance) + math.atan(
        (low - held.view.center_px[1]) / held.view.focal_px[1]
    )
    rough, cost, _ = fit(held, samples, start, _START_SCALES)
    return refine(frame, search.camera, held, rough, look, 4.0) if math.isfinite(cost) else None


def _by_what_stands(model: GoalModel, held: GoalModel, seen: GoalFit) -> GoalFit | None:
    """Fit again without the posts and the bar that are not there; None where fewer than two are.

    A post is there by both of its edges: one alone may be that of somebody who stands before half of it.
    """
    shares, least = seen.element_shares, seen.share[:BAR_TOP].reshape(2, 2).min(axis=1)
    stands = np.array([*(least >= MIN_EDGE_SHARE), True]) & (np.array(shares) >= MIN_ELEMENT_SHARE)
    stands &= np.bincount(seen.samples.edge // 2, minlength=3) >= _MIN_SAMPLES
    if stands.sum() < 2:
        return None
    samples = seen.samples
    for element in np.flatnonzero(~stands):
        samples = without_element(samples, int(element))
    p, cost, _ = fit(held, samples, seen.unknowns, _AGAIN_SCALES)
    if not math.isfinite(cost):
        return None
    _, _, information = fit(model, samples, p, _AGAIN_SCALES[:1])
    return GoalFit(p, information, samples, residuals(model, samples, p), seen.share * np.repeat(stands, 2))


def under_prior(model: GoalModel, prior: Pose2) -> GoalModel:
    """Add a prior on the pose to a model."""
    expected, weight = model.prior.copy(), model.weight.copy()
    expected[[X, Y, HEADING]] = prior.array
    weight[X] = weight[Y] = PRIOR_STD_M**-2
    weight[HEADING] = PRIOR_STD_RAD**-2
    return replace(model, prior=expected, weight=weight)
