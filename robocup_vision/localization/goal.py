"""Where the camera stands, from one picture of a goal: the direct fit, with the paper's method beside it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError, FrameError
from field_models.field import COLOR_NAMES, Field
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import FloatArray, Pose2, wrap_angle
from robocup_vision.localization.goal_edges import Look
from robocup_vision.localization.goal_fit import (
    INLIER_PX,
    GoalFit,
    GoalModel,
    bar_rows,
    fit,
    goal_model,
    objection,
    refine,
    starts,
    strip_samples,
    swung,
    with_bar,
)
from robocup_vision.localization.goal_geometry import HEADING, TILT, X, Y, goal_shape, pose_of
from robocup_vision.localization.goal_lines import (
    LineFit,
    fit_goal_and_lines,
    fit_ridges,
    line_points,
    line_starts,
    loosened,
)
from robocup_vision.localization.goal_paper import PaperMethod
from robocup_vision.localization.line_map import LineMap
from robocup_vision.perception.goal_color import hue_families, hue_masks, is_chromatic, narrower
from robocup_vision.perception.goal_region import Strip, carpet_mask, mask_runs, strips, white_runs
from robocup_vision.perception.line_points import LinePoints

ByteImage = npt.NDArray[np.uint8]
Method = Literal["edges", "paper", "angles"]

_START_SCALES = np.full(8, 100.0)
_GLARE = 235.0
# obliqueness of further starts, in shares of the first fit's
_SWINGS = (-1.0, 0.0)
_LEAST_CANDIDATE_SCORE = 0.3
_MOST_LINE_TRIALS = 4
_PRIOR_STD_M, _PRIOR_STD_RAD = 0.4, 0.15
_BEYOND_M = 0.5  # a robot may stand beside the carpet that the field file is sure of
_SEARCH_WIDTH_PX = 208  # posts of the leagues' goals are still 3 px wide there from the far end of the field


@dataclass(frozen=True, eq=False)
class GoalSight:
    """A goal in the picture.

    Parameters
    ----------
    fit : GoalFit
        For the goal at +x.
    sides : tuple of int
        Which goals it can be: (1,), (-1,), or both.
    model : GoalModel
        What it was fitted with.
    lines : LineFit or None
        The fit of goal and lines together, where lines were found; it then is the better one.
    """

    fit: GoalFit | None
    sides: tuple[int, ...]
    model: GoalModel
    lines: LineFit | None = None

    @property
    def unknowns(self) -> FloatArray:
        """(8,) float64: the camera for the goal at +x, see goal_geometry (pan/heading, tilt, roll, height among them)."""
        if self.lines is not None:
            return self.lines.unknowns
        assert self.fit is not None
        return self.fit.unknowns


class _Proposal(NamedTuple):
    """Pairs of posts to try, with what to fit them by; a last resort is tried only if nothing else was found."""

    last_resort: bool
    sides: tuple[int, ...]
    pairs: list[tuple[Strip, Strip]]
    paint: ByteImage
    scale: int
    model: GoalModel
    look: Look


class GoalLocalizer:
    """Camera position on the floor and heading of its optical axis, from posts and bar.

    Parameters
    ----------
    field : Field
        With goals of posts and a bar.
    camera : PinholeCamera
        Pan, tilt and roll may be unknown.
    use_lines : bool
        Fit the field's lines together with the goal wherever they are in view.
    method : {"edges", "paper", "angles"}
        The direct fit to silhouette edges; Yako et al.'s method as printed; or its angles with their closed form. The
        last two need coloured goals and use neither lines nor a prior.

    Raises
    ------
    ArgumentError
        If the field has no such goals, or the method is unknown or cannot see them.
    """

    def __init__(
        self, field: Field, camera: PinholeCamera, *, use_lines: bool = True, method: Method = "edges"
    ) -> None:
        self.field = field
        self.camera = camera
        self.shape = goal_shape(field)
        if method not in ("edges", "paper", "angles"):
            raise ArgumentError(f"method must be 'edges', 'paper' or 'angles', got {method!r}")
        self._method = method
        self._lines = LineMap(field) if use_lines and len(field.lines) + len(field.arcs) else None
        corners = np.abs(field.floor_polygon).max(axis=0)
        self._extent_m = corners + _BEYOND_M
        self._families = hue_families(field)
        self._white = any(not is_chromatic(goal.color) for goal in field.goals)
        if method != "edges" and not self._families:
            raise ArgumentError(f"method '{method}' finds goals by their hue, but those of '{field.name}' are white")
        self._paper = None if method == "edges" else PaperMethod(self.shape, camera, corners)
        self._colored_model = goal_model(self.shape, camera, 0.15)
        self._white_model = goal_model(self.shape, camera, 0.7)

    def locate(self, frame: ByteImage, prior: Pose2 | None = None) -> PoseEstimate | NotLocated:
        """Locate the camera.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            BGR, of the camera's size.
        prior : Pose2, optional
            Roughly where the camera is (within about a metre and 20 degrees). Where no whole goal is seen the lines are
            then tried from there, and of two candidates half a turn apart the nearer one comes first.

        Raises
        ------
        FrameError
            If the frame has the wrong type, shape or size.
        """
        if self._paper is not None:
            self._check(frame)
            return self._as_printed(self._paper, frame)
        sight = self.look(frame, prior)
        if isinstance(sight, NotLocated):
            return sight
        estimate = self._estimate(sight)
        if prior is not None and len(estimate.candidates) > 1:
            near, far = (math.hypot(c.x_m - prior.x_m, c.y_m - prior.y_m) for c in estimate.candidates)
            if far < near:
                turned = estimate.half_turn()
                return PoseEstimate(
                    turned.pose, turned.covariance, turned.inlier_share, turned.residual_px, estimate.candidates[::-1]
                )
        return estimate

    def look(self, frame: ByteImage, prior: Pose2 | None = None) -> GoalSight | NotLocated:
        """Find and fit the goal in a frame, with the field's lines where they are in view, or say why there is none.

        Parameters and errors are those of `locate`.
        """
        self._check(frame)
        sights, reason = self._sights(frame)
        if self._lines is not None:
            for sight in sights[:_MOST_LINE_TRIALS]:
                joined = self._with_lines(frame, sight)
                if joined is not None:
                    return joined
        for sight in sights:
            why = objection(sight.model, sight.fit, self._extent_m)
            if why is None:
                return sight
            reason = reason or f"no whole goal: {why}"
        if prior is not None and self._lines is not None:
            return self._from_prior(frame, prior) or NotLocated(f"{reason}; nor do lines bear out the prior")
        return NotLocated(reason or "no goal: nothing in the picture looks like a post")

    def _sights(self, frame: ByteImage) -> tuple[list[GoalSight], str]:
        """Distinct goals that may be in the picture, best first, and why there is none if there is none."""
        found: list[GoalSight] = []
        reason = ""
        for proposal in self._proposals(frame):
            if proposal.last_resort and any(objection(s.model, s.fit, self._extent_m) is None for s in found):
                break
            for left, right in proposal.pairs:
                candidates = self._candidates(frame, left, right, proposal)
                if not candidates:
                    reason = reason or "no goal: two posts may be there, but no bar that fits them"
                found += [
                    GoalSight(c, proposal.sides, proposal.model) for c in candidates if c.score > _LEAST_CANDIDATE_SCORE
                ]
                if candidates and candidates[0].score > 0.9:
                    break
        found.sort(key=lambda s: (objection(s.model, s.fit, self._extent_m) is not None, -s.fit.score))
        distinct: list[GoalSight] = []
        for sight in found:
            p = sight.fit.unknowns
            if all(math.dist(p[:2], q.fit.unknowns[:2]) > 0.05 for q in distinct):
                distinct.append(sight)
        return distinct, reason

    def _with_lines(self, frame: ByteImage, sight: GoalSight) -> GoalSight | None:
        """The same goal fitted together with the lines, or None where they do not bear it out."""
        assert self._lines is not None
        unknowns = sight.fit.unknowns
        if np.any(np.abs(unknowns[:2]) > 2 * self._extent_m):
            return None
        model = loosened(sight.model)
        starts = [unknowns]
        if sight.model is self._white_model:
            points = line_points(frame, self.camera, unknowns, self.field.line_width_m)
            if len(points) >= 20:
                starts = []
                for start in (unknowns, *line_starts(model, unknowns, points, self._lines)):
                    rough = fit_goal_and_lines(self.camera, model, start, sight.fit.samples, points, self._lines)
                    if rough is not None:
                        starts.append((rough.line_share, rough.unknowns))  # type: ignore[arg-type]
                starts = [max(starts, key=lambda r: r[0])[1]] if starts else [unknowns]
        joined = fit_ridges(
            frame, self.camera, model, starts[0], sight.fit.samples, self._lines, self.field.line_width_m
        )
        if joined is None or np.any(np.abs(joined.unknowns[:2]) > self._extent_m):
            return None
        return GoalSight(sight.fit, sight.sides, model, joined)

    def _from_prior(self, frame: ByteImage, prior: Pose2) -> GoalSight | None:
        """Lines alone, from where the camera is believed to be; its tilt is searched where it is unknown."""
        assert self._lines is not None
        model = loosened(self._white_model)
        p = model.prior.copy()
        p[X], p[Y], p[HEADING] = prior.x_m, prior.y_m, prior.theta_rad
        tilts = [p[TILT]] if model.weight[TILT] > 0 else np.arange(-0.45, 0.3, 0.02).tolist()
        best: LineFit | None = None
        for tilt in tilts:
            p[TILT] = tilt
            points = self._tilted_points(frame, p)
            if len(points) < 20:
                continue
            weight = model.weight.copy()
            weight[X] = weight[Y] = 1 / _PRIOR_STD_M**2
            weight[HEADING] = 1 / _PRIOR_STD_RAD**2
            held = GoalModel(model.shape, model.view, p.copy(), weight)
            rough = fit_goal_and_lines(self.camera, held, p, None, points, self._lines)
            if rough is not None and (best is None or rough.line_share > best.line_share):
                best = rough
        if best is None:
            return None
        joined = fit_ridges(frame, self.camera, model, best.unknowns, None, self._lines, self.field.line_width_m)
        if joined is None:
            return None
        offset = math.hypot(joined.unknowns[X] - prior.x_m, joined.unknowns[Y] - prior.y_m)
        turn = abs(wrap_angle(float(joined.unknowns[HEADING]) - prior.theta_rad))
        if offset > 3 * _PRIOR_STD_M or turn > 3 * _PRIOR_STD_RAD:
            return None
        return GoalSight(None, (1,), model, joined)

    def _tilted_points(self, frame: ByteImage, p: FloatArray) -> LinePoints:
        assert self._lines is not None
        return line_points(frame, self.camera, p, self.field.line_width_m)

    def _proposals(self, frame: ByteImage) -> Iterator[_Proposal]:
        """Where goals may be: by each goal's hue, then for white goals by their edges, then by half of each hue."""
        factor = max(1, round(self.camera.size_px[0] / _SEARCH_WIDTH_PX))
        if self._families:
            small = frame
            if factor > 1:
                small = np.asarray(
                    cv2.resize(frame, None, fx=1 / factor, fy=1 / factor, interpolation=cv2.INTER_AREA), np.uint8
                )
            masks = hue_masks(small, self._families)
            painted = np.zeros(small.shape[:2], np.uint8)
            for mask in masks.values():
                painted |= mask
            carpet = carpet_mask(small, painted)
            halves = narrower(self._families)
            for k, color in [(k, color) for k in range(1 + len(halves)) for color in self._families]:
                mask = masks[color] if k == 0 else hue_masks(small, halves[k - 1])[color]
                found = [_enlarged(s, factor) for s in strips(mask_runs(mask, 2), 2, carpet, certain=True)]
                sides = tuple(goal.side for goal in self.field.goals if goal.color == color)
                look = Look(_towards(color), _GLARE, 0.0)
                yield _Proposal(
                    k > 0, sides, self._pairs(found, 6, needs_feet=False), mask, factor, self._colored_model, look
                )
        if self._white:
            found = strips(white_runs(frame, 4), 4, carpet_mask(frame), certain=False)
            sides = tuple(goal.side for goal in self.field.goals if not is_chromatic(goal.color))
            paint = np.asarray(cv2.min(cv2.min(frame[..., 0], frame[..., 1]), frame[..., 2]), np.uint8)
            look = Look(np.full(3, 3**-0.5), math.inf, 1.0)
            yield _Proposal(False, sides, self._pairs(found, 20, needs_feet=True), paint, 1, self._white_model, look)

    def _pairs(self, found: list[Strip], most: int, *, needs_feet: bool) -> list[tuple[Strip, Strip]]:
        """Pairs of strips that can be the posts of one goal, the strongest first."""
        wide = self.shape.width_m / (2 * self.shape.radius_m)
        pairs = []
        for a, b in itertools.permutations(found, 2):
            if not (math.isfinite(a.foot) and math.isfinite(b.foot)) and needs_feet:
                continue
            apart = b.axis_at(b.bottom) - a.axis_at(a.bottom)
            width_a, width_b = max(a.width_at(a.bottom), 1.0), max(b.width_at(b.bottom), 1.0)
            # the posts' distance is at most as many post widths as in the goal, and fewer seen from the side
            if not 0.25 * wide * min(width_a, width_b) < apart < 1.5 * wide * max(width_a, width_b):
                continue
            if not 0.45 < width_a / width_b < 2.2 or abs(a.bottom - b.bottom) > apart:
                continue
            pairs.append((a.strength * b.strength, a, b))
        pairs.sort(key=lambda pair: -pair[0])
        return [(a, b) for _, a, b in pairs[:most]]

    def _candidates(self, frame: ByteImage, left: Strip, right: Strip, proposal: _Proposal) -> list[GoalFit]:
        """Fits to a pair of strips, best first: for each row the bar may be in, from several obliquenesses."""
        model, look = proposal.model, proposal.look
        samples = strip_samples(self.camera, left, right)
        rough = [fit(model, samples, start, _START_SCALES) for start in starts(model, left, right)]
        rough = [r for r in rough if math.isfinite(r[1]) and r[0][X] < self.shape.line_x_m - 0.2]
        if not rough:
            return []
        found: list[GoalFit] = []
        p0 = min(rough, key=lambda r: r[1])[0]
        for bar in bar_rows(proposal.paint, proposal.scale, model, p0, 3):
            joint = with_bar(samples, bar)
            tried = [fit(model, joint, start, _START_SCALES) for start, _, _ in rough]
            start, cost, _ = min(tried, key=lambda r: r[1])
            if not math.isfinite(cost):
                continue
            straight = refine(frame, self.camera, model, start, look, 3.0 * max(1.0, proposal.scale / 1.5))
            if straight is None:
                continue
            found.append(straight)
            for share in _SWINGS:
                other, cost, _ = fit(model, straight.samples, swung(model, straight.unknowns, share), _START_SCALES[:5])
                if not math.isfinite(cost) or any(math.dist(other[:2], f.unknowns[:2]) < 0.03 for f in found):
                    continue
                turned = refine(frame, self.camera, model, other, look)
                if turned is not None:
                    found.append(turned)
        return sorted(found, key=lambda f: -f.score)

    def _as_printed(self, paper: PaperMethod, frame: ByteImage) -> PoseEstimate | NotLocated:
        """Yako et al.: the colour with the larger region is the goal in view."""
        masks = hue_masks(np.asarray(cv2.bilateralFilter(frame, 5, 30, 3)), self._families)
        color = max(masks, key=lambda name: int(cv2.countNonZero(masks[name])))
        estimate = paper.locate(masks[color], closed_form=self._method == "angles")
        at_positive = any(goal.side > 0 for goal in self.field.goals if goal.color == color)
        return estimate if isinstance(estimate, NotLocated) or at_positive else estimate.half_turn()

    def _estimate(self, sight: GoalSight) -> PoseEstimate:
        chosen = np.ix_((X, Y, HEADING), (X, Y, HEADING))
        if sight.lines is not None:
            residual, covariance = sight.lines.residual_px, sight.lines.covariance[chosen]
            share = sight.lines.line_share
        else:
            assert sight.fit is not None
            edges = sight.fit.residual_px[: len(sight.fit.samples.edge)]
            residual = edges[np.abs(edges) < INLIER_PX]
            covariance = np.linalg.inv(sight.fit.information)[chosen]
            share = len(residual) / max(len(edges), 1)
        pose = pose_of(sight.unknowns)
        estimate = PoseEstimate(
            pose,
            (covariance + covariance.T) / 2,
            share,
            float(np.sqrt(np.mean(residual**2))) if len(residual) else 0.0,
            (pose,) if len(sight.sides) == 1 else (pose, pose.half_turn()),
        )
        return estimate.half_turn() if sight.sides[0] < 0 else estimate

    def _check(self, frame: ByteImage) -> None:
        width, height = self.camera.size_px
        if not isinstance(frame, np.ndarray) or frame.dtype != np.uint8 or frame.shape != (height, width, 3):
            got = f"{frame.dtype} {frame.shape}" if isinstance(frame, np.ndarray) else type(frame).__name__
            raise FrameError(f"frame must be uint8 ({height}, {width}, 3) as camera.toml says, got {got}")


def _towards(color: str) -> FloatArray:
    """Direction (3,) in BGR from carpet, lines and walls to a paint: brighter in its own channels than in the others."""
    paint = np.array(COLOR_NAMES[color], dtype=np.float64)
    away = paint - paint.mean()
    return np.asarray(away / np.linalg.norm(away))


def _enlarged(strip: Strip, factor: int) -> Strip:
    """The same strip in an image `factor` times larger; pixel centres are at integers."""
    if factor == 1:
        return strip
    shift = (factor - 1) / 2

    def edge(line: tuple[float, float]) -> tuple[float, float]:
        at, lean = line
        return factor * at + shift - lean * shift, lean

    return Strip(
        edge(strip.left),
        edge(strip.right),
        strip.top * factor + shift,
        strip.bottom * factor + shift,
        strip.foot * factor + shift,
        strip.strength,
    )
