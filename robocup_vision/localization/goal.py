"""Where the camera stands, from one picture of a goal: the direct fit, with the paper's method beside it."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError, FrameError
from field_models.field import COLOR_NAMES, Field
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import FloatArray, Pose2
from robocup_vision.localization.goal_fit import (
    GoalFit,
    GoalModel,
    bar_rows,
    fit,
    goal_model,
    mirrored,
    objection,
    refine,
    starts,
    strip_samples,
    with_bar,
)
from robocup_vision.localization.goal_geometry import BLOOM, HEADING, X, Y, goal_shape, pose_of
from robocup_vision.perception.goal_color import hue_families, hue_masks, is_chromatic, narrower
from robocup_vision.perception.goal_region import Strip, carpet_mask, mask_runs, strips, white_runs

ByteImage = npt.NDArray[np.uint8]

_START_SCALES = np.full(8, 100.0)
_GLARE = 235.0
import os
GREY=float(os.environ.get('GREY','0'))
_BEYOND_M = 0.5  # a robot may stand beside the carpet that the field file is sure of
_WHITE = np.full(3, 3**-0.5)
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
    """

    fit: GoalFit
    sides: tuple[int, ...]
    model: GoalModel


class GoalLocalizer:
    """Camera position on the floor and heading of its optical axis, from posts and bar.

    Parameters
    ----------
    field : Field
        With goals of posts and a bar.
    camera : PinholeCamera
        Pan, tilt and roll may be unknown.

    Raises
    ------
    ArgumentError
        If the field has no such goals.
    """

    def __init__(self, field: Field, camera: PinholeCamera) -> None:
        self.field = field
        self.camera = camera
        self.shape = goal_shape(field)
        corners = np.abs(field.floor_polygon).max(axis=0)
        self._extent_m = corners + _BEYOND_M
        self._families = hue_families(field)
        self._white = any(not is_chromatic(goal.color) for goal in field.goals)
        self._colored_model = goal_model(self.shape, camera, 0.15)
        self._white_model = goal_model(self.shape, camera, 0.7)

    def locate(self, frame: ByteImage, prior: Pose2 | None = None) -> PoseEstimate | NotLocated:
        """Locate the camera.

        Parameters
        ----------
        frame : (H, W, 3) uint8
            BGR, of the camera's size.
        prior : Pose2, optional
            Roughly where the camera is.

        Raises
        ------
        FrameError
            If the frame has the wrong type, shape or size.
        """
        self._check(frame)
        sight = self.look(frame)
        if isinstance(sight, NotLocated):
            return sight
        return self._estimate(sight)

    def look(self, frame: ByteImage) -> GoalSight | NotLocated:
        """Find and fit the goal in a frame, or say why there is none."""
        best: GoalSight | None = None
        reason = "no goal: nothing in the picture looks like a post"
        for sides, pairs, paint, scale, model, towards, glare, grey in self._proposals(frame):
            if best is not None:
                break
            for left, right in pairs:
                found = self._fit_pair(frame, left, right, paint, scale, model, towards, glare, grey)
                if found is None:
                    reason = "no goal: two posts may be there, but no bar that fits them"
                    continue
                why = objection(model, found, self._extent_m)
                if why is not None:
                    reason = f"no whole goal: {why}"
                elif best is None or found.score > best.fit.score:
                    best = GoalSight(found, sides, model)
                if found.score > 0.9:
                    break
        if best is None:
            return NotLocated(reason)
        return best

    def _proposals(self, frame: ByteImage):  # type: ignore[no-untyped-def]
        factor = max(1, round(self.camera.size_px[0] / _SEARCH_WIDTH_PX))
        if self._families:
            small = frame if factor == 1 else cv2.resize(
                frame, None, fx=1 / factor, fy=1 / factor, interpolation=cv2.INTER_AREA
            )
            masks = hue_masks(small, self._families)
            painted = None
            for mask in masks.values():
                painted = mask if painted is None else cv2.bitwise_or(painted, mask)
            carpet = carpet_mask(small, painted)
            for color, mask in itertools.chain(
                masks.items(),
                *(hue_masks(small, half).items() for half in narrower(self._families) if self._families),
            ):
                found = strips(mask_runs(mask, 2), 2, carpet, certain=True)
                grown = [_enlarged(s, factor) for s in found]
                sides = tuple(goal.side for goal in self.field.goals if goal.color == color)
                towards = _towards(color)
                yield sides, self._pairs(grown, 6, needs_feet=False), mask, factor, self._colored_model, towards, _GLARE, GREY
        if self._white:
            carpet = carpet_mask(frame)
            found = strips(white_runs(frame, 4), 4, carpet, certain=False)
            sides = tuple(goal.side for goal in self.field.goals if not is_chromatic(goal.color))
            paint = np.asarray(cv2.min(cv2.min(frame[..., 0], frame[..., 1]), frame[..., 2]))
            yield sides, self._pairs(found, 20, needs_feet=True), paint, 1, self._white_model, _WHITE, 300.0, 1.0

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

    def _fit_pair(
        self,
        frame: ByteImage,
        left: Strip,
        right: Strip,
        paint: ByteImage,
        scale: float,
        model: GoalModel,
        towards: FloatArray,
        glare: float,
        grey: float,
    ) -> GoalFit | None:
        samples = strip_samples(self.camera, left, right)
        rough = [fit(model, samples, start, _START_SCALES) for start in starts(model, left, right)]
        rough = [r for r in rough if math.isfinite(r[1]) and r[0][X] < self.shape.line_x_m - 0.2]
        if not rough:
            return None
        best: GoalFit | None = None
        p0 = min(rough, key=lambda r: r[1])[0]
        for bar in bar_rows(paint, scale, self.camera, model, p0, 3):
            joint = with_bar(samples, bar)
            tried = [fit(model, joint, start, _START_SCALES) for start, _, _ in rough]
            start, cost, _ = min(tried, key=lambda r: r[1])
            if not math.isfinite(cost):
                continue
            found = refine(frame, self.camera, model, start, towards, glare, grey, 3.0 * max(1.0, scale / 1.5))
            if found is None:
                continue
            other, cost, _ = fit(model, found.samples, mirrored(model, found.unknowns), _START_SCALES)
            turned = refine(frame, self.camera, model, other, towards, glare, grey) if math.isfinite(cost) else None
            for candidate in (found, turned):
                if candidate is not None and (best is None or candidate.score > best.score):
                    best = candidate
        return best

    def _estimate(self, sight: GoalSight) -> PoseEstimate:
        pose = pose_of(sight.fit.unknowns)
        covariance = np.linalg.inv(sight.fit.information)[np.ix_((X, Y, HEADING), (X, Y, HEADING))]
        edges = sight.fit.residual_px[: len(sight.fit.samples.edge)]
        inlier = np.abs(edges) < 0.5
        estimate = PoseEstimate(
            pose,
            covariance,
            float(inlier.mean()),
            float(np.sqrt(np.mean(edges[inlier] ** 2))) if inlier.any() else 0.0,
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
