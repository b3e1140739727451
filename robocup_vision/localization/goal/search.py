"""From a frame to goals that may be in it: posts as strips, their pairs, the bar between, fitted to edges."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np

from field_models.field import COLOR_NAMES, Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.kernels.goal.paint.strips import mean_along
from robocup_vision.localization.distinct import Apart
from robocup_vision.localization.goal.arc import turned
from robocup_vision.localization.goal.edges import EdgeAppearance, from_ideal
from robocup_vision.localization.goal.fit import (
    BLOOM_STD_HUE_PX,
    BLOOM_STD_WHITE_PX,
    GoalFit,
    GoalModel,
    agreement,
    fit,
    goal_model,
    refine,
    residuals,
)
from robocup_vision.localization.goal.geometry import HEADING, UNKNOWNS, X, Y, goal_shape, project
from robocup_vision.localization.goal.goal_picture import GoalPicture
from robocup_vision.localization.goal.silhouettes import SilhouetteSearch
from robocup_vision.localization.goal.starts import bar_rows, start_by_posts, strip_samples, with_bar
from robocup_vision.perception.goal_region import (
    Strip,
    carpet_mask,
    enlarged,
    hue_families,
    mask_runs,
    strips,
    white_runs,
)

_START_SCALES = np.full(8, 100.0)
_GLARE = 235.0  # samples brighter than this, of paint half washed white, are dropped
# score from which the search ends: edges of clutter agree with a goal in half of their places at most
_CLEAR_SCORE = 0.8
_MIN_SCORE = 0.3  # candidates below are dropped: weighing each takes time
# evidence, nats, of edges of a silhouette that all lie at their places to a fraction of a pixel, in addition to
# that of their presence
_EXACT_NATS = 100.0
_APART = Apart(0.03)  # of two fits
# least distance from the goal's plane: nearer, one post hides the other and the bar coincides with both
EDGE_ON_M = 0.2
_BEYOND_M = 0.5  # a robot may stand this far outside the carpet that the field file guarantees
_MAX_PAIRS = 14  # pairs of strips that are tried as posts


@dataclass(frozen=True, eq=False)
class Candidate:
    """A goal that may be in the picture."""

    fit: GoalFit  #: for the goal at +x
    sides: tuple[int, ...]  #: which goals it can be: (1,), (-1,), or both
    model: GoalModel  #: of its fit
    appearance: EdgeAppearance
    nats: float  #: log-likelihood ratio of the goal to clutter, by which several are ordered
    is_clear: bool  #: whether its edges agree so well that the search may end


class Proposal(NamedTuple):
    """Strips that may be posts, with what to fit them by."""

    sides: tuple[int, ...]
    found: list[Strip]
    pairs: list[tuple[Strip, Strip]]
    paint: UInt8Array
    carpet: UInt8Array
    scale: int
    model: GoalModel
    appearance: EdgeAppearance


class GoalSearch:
    """Finds goals of one field in the frames of one camera, whose pan, tilt and roll may be unknown.

    Raises
    ------
    ArgumentError
        If the field has no goals of posts and a bar.
    """

    def __init__(
        self,
        field: Field,
        camera: PinholeCamera,
    ) -> None:
        self.field = field
        self.camera = camera
        self.shape = goal_shape(field)
        self.extent_m = np.abs(field.floor_polygon).max(axis=0) + _BEYOND_M
        self.families = hue_families(field)
        self.colored_model = goal_model(self.shape, camera, BLOOM_STD_HUE_PX)
        self.white_model = goal_model(self.shape, camera, BLOOM_STD_WHITE_PX)
        self._silhouettes = SilhouetteSearch(self.colored_model, camera, self.extent_m)

    def picture(self, frame: UInt8Array) -> GoalPicture:
        """Take a frame (H, W, 3), BGR, of the camera's size."""
        return GoalPicture(frame, self.families, self._silhouettes)

    def candidates(self, picture: GoalPicture) -> tuple[list[Candidate], str]:
        """Goals that may be in a picture, distinct ones, best first; and why there is none if there is none."""
        found: list[Candidate] = []
        reason = "no goal: nothing in the picture looks like two posts"
        pairs = ((proposal, *pair) for proposal in self.proposals(picture) for pair in proposal.pairs)
        for proposal, left, right in pairs:
            fits = self._fits(picture.frame, left, right, proposal)
            if not fits:
                reason = "no goal: two posts may be there, but no bar that fits them"
            found += self._judged(picture, fits, proposal)
            if any(c.is_clear for c in found):
                break
        if self.families and not any(c.is_clear for c in found):
            found += self.by_silhouettes(picture)
        found.sort(key=lambda c: -c.nats)
        return [found[k] for k in self._distinct([c.fit.unknowns for c in found])], reason

    def _distinct(self, cameras: list[FloatArray]) -> list[int]:
        """Return which of some cameras (8,) have no other before them at the same place."""
        poses = np.array(cameras).reshape(-1, UNKNOWNS)[:, [X, Y, HEADING]]
        return _APART.first(poses, len(cameras))

    def _judged(self, picture: GoalPicture, fits: list[GoalFit], proposal: Proposal) -> list[Candidate]:
        judged = []
        for found in fits:
            if found.score > _MIN_SCORE:
                is_clear = found.score > _CLEAR_SCORE and self.is_possible(found.unknowns)
                one = Candidate(found, proposal.sides, proposal.model, proposal.appearance, 0.0, is_clear)
                judged.append(replace(one, nats=self.nats(picture, one, found.unknowns)))
        return judged

    def is_possible(self, unknowns: FloatArray) -> bool:
        """Whether a camera (8,) stands on the pitch or beside it."""
        return bool(np.all(np.abs(unknowns[:2]) <= self.extent_m))

    def proposals(self, picture: GoalPicture) -> Iterator[Proposal]:
        """Yield where goals may be: by each goal's hue, or white ones by their edges."""
        if self.families:
            masks = picture.masks
            for color in self.families:
                mask = masks.paint[color]
                yield self._of_hue(color, mask, masks.carpet, self._mask_strips(mask, masks.carpet), picture.factor)
        else:
            carpet = carpet_mask(picture.frame)
            runs = white_runs(picture.whiteness, 4)
            found = strips(runs, 4, carpet, certain=False)
            sides = tuple(goal.side for goal in self.field.goals)
            appearance = EdgeAppearance(np.full(3, 3**-0.5), math.inf, 1.0)
            pairs = self._pairs([s for s in found if math.isfinite(s.foot)])
            yield Proposal(sides, found, pairs, picture.whiteness, carpet, 1, self.white_model, appearance)

    def by_silhouettes(self, picture: GoalPicture) -> list[Candidate]:
        """Goals that paint alone does not show: washed by lamps, or before something of a neighbouring hue."""
        paint, carpet = picture.masks
        straight = picture.straight_masks
        found: list[Candidate] = []
        # the hue of a goal in view covers more of the picture than the other one
        for color in sorted(self.families, key=lambda one: -cv2.countNonZero(straight.paint[one])):
            proposal = self._of_hue(color, paint[color], carpet, [], picture.factor)
            appearance = replace(proposal.appearance, paint=picture.washable(color))
            proposal = proposal._replace(appearance=appearance)
            for _, start in self._silhouettes.propose(picture.gradients, straight.paint[color], straight.carpet):
                fit = refine(picture.frame, self.camera, proposal.model, start, appearance)
                found += [] if fit is None else self._judged(picture, [fit], proposal)
            if any(one.is_clear for one in found):
                break
        return found

    def nats(self, picture: GoalPicture, candidate: Candidate, unknowns: FloatArray) -> float:
        """Log-likelihood ratio of a picture to clutter if a camera (8,) sees the goal; minus infinity behind it.

        Of a white goal its edges' accuracy alone: what its paint covers, other white things cover, too.
        """
        nats = 0.0
        if self.families:
            nats = self._silhouettes.nats(picture.evidence(self._color_of(candidate.sides)), unknowns)
        if math.isinf(nats):
            return nats
        fit = candidate.fit
        score = agreement(fit.samples, residuals(candidate.model, fit.samples, unknowns))
        return nats + _EXACT_NATS * score

    def washable(self, picture: GoalPicture, sides: tuple[int, ...], unknowns: FloatArray) -> FloatArray:
        """Measure the fractions (3,) of left post, bar and right post that may be paint, for a camera (8,)."""
        mask = picture.washable(self._color_of(sides))
        corners = project(self.colored_model.view, unknowns, self.shape.corners)
        pixels = (from_ideal(self.camera, corners) + 0.5) / picture.factor - 0.5
        painted = np.empty(3)
        mean_along(mask, np.ascontiguousarray(pixels[:-1]), np.ascontiguousarray(pixels[1:]), painted)
        return painted / 255

    def _color_of(self, sides: tuple[int, ...]) -> str:
        return next(goal.color for goal in self.field.goals if goal.side == sides[0])

    def _mask_strips(self, mask: UInt8Array, carpet: UInt8Array) -> list[Strip]:
        return strips(mask_runs(mask, 2), 2, carpet, certain=True)

    def _of_hue(self, color: str, mask: UInt8Array, carpet: UInt8Array, found: list[Strip], factor: int) -> Proposal:
        found = [enlarged(s, factor) for s in found]
        sides = tuple(goal.side for goal in self.field.goals if goal.color == color)
        paint = np.array(COLOR_NAMES[color], dtype=np.float64)
        away = paint - paint.mean()
        appearance = EdgeAppearance(away / float(np.linalg.norm(away)), _GLARE, 0.0)
        return Proposal(sides, found, self._pairs(found), mask, carpet, factor, self.colored_model, appearance)

    def _pairs(self, found: list[Strip]) -> list[tuple[Strip, Strip]]:
        """Pairs of strips that can be the posts of one goal, the strongest first."""
        wide = self.shape.width_m / (2 * self.shape.radius_m)
        focal_px = self.camera.focal_px[0]
        pairs = []
        for a, b in itertools.permutations(found, 2):
            apart = b.axis_at(b.bottom) - a.axis_at(a.bottom)
            width_a, width_b = max(a.width_at(a.bottom), 1.0), max(b.width_at(b.bottom), 1.0)
            # the posts' distance is at most as many post widths as in the goal, and fewer seen from the side
            if not 0.25 * wide * min(width_a, width_b) < apart < 1.5 * wide * max(width_a, width_b):
                continue
            # posts as near as their widths suggest are no farther from each other in depth than in the goal
            depth_m = 2 * self.shape.radius_m * focal_px * abs(1 / width_a - 1 / width_b)
            unlike = not 0.45 < width_a / width_b < 2.2 and depth_m > self.shape.width_m
            if unlike or abs(a.bottom - b.bottom) > apart:
                continue
            pairs.append((a.strength * b.strength, a, b))
        pairs.sort(key=lambda pair: -pair[0])
        return [(a, b) for _, a, b in pairs[:_MAX_PAIRS]]

    def _fits(self, frame: UInt8Array, left: Strip, right: Strip, proposal: Proposal) -> list[GoalFit]:
        """Fits to a pair of strips: one for each row that the bar may be in, and the best one's other branch."""
        model, appearance = proposal.model, proposal.appearance
        samples = strip_samples(self.camera, ((0, left), (1, right)))
        posts_only, cost, _ = fit(model, samples, start_by_posts(model, left, right), _START_SCALES)
        if not math.isfinite(cost) or posts_only[X] > self.shape.line_x_m - EDGE_ON_M:
            return []
        found: list[GoalFit] = []
        for bar in bar_rows(proposal.paint, proposal.scale, model, posts_only, 3):
            start, cost, _ = fit(model, with_bar(samples, bar), posts_only, _START_SCALES)
            if not math.isfinite(cost):
                continue
            one = refine(frame, self.camera, model, start, appearance, 3.0 * max(1.0, proposal.scale / 1.5))
            found += [] if one is None else [one]
            if one is not None and one.score > _CLEAR_SCORE:
                break  # no other bar row fits better
        found.sort(key=lambda f: -f.score)
        if found:
            other = self._other_branch(frame, found[0], proposal)
            found += [] if other is None else [other]
        return found

    def _other_branch(self, frame: UInt8Array, found: GoalFit, proposal: Proposal) -> GoalFit | None:
        """Fit the camera on the other side of the goal's axis whose picture of a plane is nearly the same, if any."""
        model, p = proposal.model, found.unknowns
        aside_rad = math.atan2(p[Y], model.shape.line_x_m - p[X])
        start, cost, _ = fit(model, found.samples, turned(model, p, 2 * aside_rad), _START_SCALES)
        if not math.isfinite(cost) or len(self._distinct([p, start])) < 2:
            return None
        return refine(frame, self.camera, model, start, proposal.appearance)
