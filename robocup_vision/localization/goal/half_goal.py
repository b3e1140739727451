"""Half a goal, fitted from a prior pose of the camera: one post and the bar, or two posts without it.

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
from robocup_vision.localization.goal.edges import EdgeAppearance
from robocup_vision.localization.goal.fit import (
    GoalFit,
    GoalModel,
    fit,
    only,
    refine,
    residuals,
)
from robocup_vision.localization.goal.geometry import BAR_TOP, HEADING, TILT, X, Y
from robocup_vision.localization.goal.goal_picture import GoalPicture
from robocup_vision.localization.goal.search import EDGE_ON_M, Candidate, GoalSearch
from robocup_vision.localization.goal.starts import strip_samples
from robocup_vision.perception.goal_region import Strip

_START_SCALES, _AGAIN_SCALES = np.full(8, 100.0), np.ones(3)
_AROUND = np.ones((3, 3), np.uint8)
# standard deviations of the prior's position and heading: odometry over a few seconds
PRIOR_STD_M = 0.4
PRIOR_STD_RAD = 0.15
_MIN_SAMPLES = 6  # least edge samples of a visible post or bar
# least inliers among the expected samples of a visible post or bar, and of each edge of a visible post
_MIN_ELEMENT_RATIO = 0.45
_MIN_EDGE_RATIO = 0.2
_MAX_STRIPS = 6  # strips that are tried as posts


def find_half_goal(search: GoalSearch, picture: GoalPicture, prior: Pose2) -> Candidate | None:
    """Fit one post and the bar, or two posts without it, near a prior pose; None where less is in view.

    The prior is not part of the information of the result: a filter that the prior comes from may update with it.
    """
    best: Candidate | None = None
    for proposal in search.proposals(picture):
        appearance = proposal.appearance
        if proposal.model is search.colored_model:
            # what hides the rest of the goal has edges of its own, but no paint inside
            appearance = replace(
                appearance, paint=np.asarray(cv2.dilate(cv2.medianBlur(proposal.paint, 3), _AROUND), np.uint8)
            )
        for side in proposal.sides:
            constrained = under_prior(proposal.model, prior if side > 0 else prior.half_turn())
            for strip, post in itertools.product(proposal.found[:_MAX_STRIPS], (0, 1)):
                whole = _fit_one_post(search, picture.frame, strip, post, constrained, appearance)
                seen = None if whole is None else _without_missing(proposal.model, constrained, whole)
                if seen is None or seen.unknowns[X] > constrained.shape.line_x_m - EDGE_ON_M:
                    continue
                offset = (seen.unknowns - constrained.prior)[[X, Y, HEADING]]
                if np.any(np.abs(offset) > 3 * np.array([PRIOR_STD_M, PRIOR_STD_M, PRIOR_STD_RAD])):
                    continue
                if best is None or seen.score > best.fit.score:
                    # the prior chooses the side, and is no evidence of it
                    sides = (side, *(other for other in proposal.sides if other != side))
                    best = Candidate(seen, sides, proposal.model, proposal.appearance, seen.score, False)
    return best


def _fit_one_post(
    search: GoalSearch, frame: UInt8Array, strip: Strip, post: int, constrained: GoalModel, appearance: EdgeAppearance
) -> GoalFit | None:
    samples = strip_samples(search.camera, ((post, strip),))
    start = constrained.prior.copy()
    # the strip's foot gives the tilt, and the post's place the heading
    distance = math.hypot(constrained.shape.line_x_m - start[X], constrained.shape.post_y_m[post] - start[Y])
    low = strip.foot if math.isfinite(strip.foot) else strip.bottom
    start[TILT] = -math.atan(search.camera.height_m / distance) + math.atan(
        (low - constrained.view.center_px[1]) / constrained.view.focal_px[1]
    )
    rough, cost, _ = fit(constrained, samples, start, _START_SCALES)
    return refine(frame, search.camera, constrained, rough, appearance, 4.0) if math.isfinite(cost) else None


def _without_missing(model: GoalModel, constrained: GoalModel, seen: GoalFit) -> GoalFit | None:
    """Fit again without the posts and the bar that are missing; None where fewer than two are present.

    A post is present if both of its edges are: one alone may be that of somebody who hides half of it.
    """
    least = seen.edge_ratio[:BAR_TOP].reshape(2, 2).min(axis=1)
    stands = np.array([*(least >= _MIN_EDGE_RATIO), True])
    stands &= np.array(seen.element_ratios) >= _MIN_ELEMENT_RATIO
    stands &= np.bincount(seen.samples.edge // 2, minlength=3) >= _MIN_SAMPLES
    if stands.sum() < 2:
        return None
    samples = only(seen.samples, np.repeat(stands, 2), stands[:2])
    p, cost, _ = fit(constrained, samples, seen.unknowns, _AGAIN_SCALES)
    if not math.isfinite(cost):
        return None
    _, _, information = fit(model, samples, p, _AGAIN_SCALES[:1])
    ratio = seen.edge_ratio * np.repeat(stands, 2)
    return GoalFit(p, information, samples, residuals(model, samples, p), ratio)


def under_prior(model: GoalModel, prior: Pose2) -> GoalModel:
    """Add a prior on the pose to a model."""
    expected, weight = model.prior.copy(), model.weight.copy()
    expected[[X, Y, HEADING]] = prior.array
    weight[X] = weight[Y] = PRIOR_STD_M**-2
    weight[HEADING] = PRIOR_STD_RAD**-2
    return replace(model, prior=expected, weight=weight)
