"""Goal posts in a forward camera's frame: upright strips on the carpet that have a post's width and height there."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.perception.goal_region import (
    Strip,
    carpet_mask,
    hue_families,
    hue_masks,
    is_chromatic,
    mask_runs,
    strips,
    white_runs,
    whiteness,
)
from robocup_vision.perception.markings.correlated_errors import FloorErrors
from robocup_vision.perception.markings.marking import MAX_STD_M, Post

_WHITE_STEP, _HUE_STEP = 4, 2
# width in the picture of the thinnest post that can be distinguished from clutter
_MIN_POST_PX = 3.0
# largest ratio of a post's width in the picture to the expected one, and its inverse the smallest
_POST_WIDTH_RATIO = 1.35
# smallest visible part of a post's height within the picture
_MIN_POST_RATIO = 0.6
# smallest brightness of a white post's dark parts, relative to its bright ones
_MIN_SOLID_RATIO = 0.75
# smallest contrast of a post's edges relative to the clearest post's
_MIN_CONTRAST_RATIO = 0.75
# smallest distance of two posts, in goal widths
_MIN_POSTS_APART = 0.5
# standard deviation of a post's foot in the picture: across, and down, where carpet begins in whole rows
_POST_STD_PX = (0.3, 0.7)


class PostFinder:
    """Finds the posts of a field's goals of posts."""

    def __init__(self, field: Field) -> None:
        self._goals = [goal for goal in field.goals if goal.kind == "posts"]
        self._families = hue_families(field) if self._goals else {}
        self._has_white = any(not is_chromatic(goal.color) for goal in self._goals)

    def find(self, frame: UInt8Array, errors: FloorErrors) -> list[Post]:
        """Return the posts in a frame (H, W, 3) uint8 BGR, the most accurate first."""
        camera = errors.camera
        # in a mirror upright objects are radial, not vertical
        if not self._goals or not isinstance(camera, PinholeCamera):
            return []
        found: list[Post] = []
        contrast = 0.0
        # fainter strips, and those next to a post, are its net or shadow
        for strip in sorted(self._strips(frame), key=lambda one: -one.strength):
            post = self._post(strip, camera, errors)
            own = strip.strength / max(strip.height, 1.0)
            if post is None or own < _MIN_CONTRAST_RATIO * contrast:
                continue
            apart_m = [math.hypot(post.x_m - other.x_m, post.y_m - other.y_m) for other in found]
            if min(apart_m, default=math.inf) > _MIN_POSTS_APART * self._goals[0].width_m:
                found.append(post)
                contrast = max(contrast, own)
        return sorted(found, key=lambda one: float(np.trace(one.covariance)))

    def _strips(self, frame: UInt8Array) -> Iterator[Strip]:
        if self._families:
            masks = hue_masks(frame, self._families)
            for mask in masks.values():
                yield from strips(mask_runs(mask, _HUE_STEP), _HUE_STEP, carpet_mask(frame, mask), certain=True)
        if self._has_white:
            white = whiteness(frame)
            found = strips(white_runs(white, _WHITE_STEP), _WHITE_STEP, carpet_mask(frame), certain=False)
            yield from (strip for strip in found if _is_solid(white, strip))

    def _post(self, strip: Strip, camera: PinholeCamera, errors: FloorErrors) -> Post | None:
        """Return a strip as a post; None if it does not have its size."""
        goal = self._goals[0]
        if not math.isfinite(strip.foot):
            return None
        foot_px = np.array([strip.axis_at(strip.foot), strip.foot])
        foot_m = camera.pixel_to_floor(foot_px)
        shifts = errors.shifts_m(foot_px)
        if not (np.isfinite(foot_m).all() and np.isfinite(shifts).all()):
            return None
        away = foot_m - camera.viewpoint_m[:2]
        range_m = float(np.hypot(*away))
        # the visible foot is the near side
        axis_m = foot_m + goal.post_radius_m * away / max(range_m, 1e-9)
        side_m = goal.post_radius_m * np.array([-away[1], away[0]]) / max(range_m, 1e-9)
        rim = camera.floor_to_pixel(np.stack([axis_m + side_m, axis_m - side_m]))
        width_px = float(np.hypot(*(rim[1] - rim[0])))
        top = camera.point_to_pixel(np.array([*axis_m, goal.height_m]))
        if not (np.isfinite(rim).all() and width_px >= _MIN_POST_PX):
            return None
        if not 1 / _POST_WIDTH_RATIO <= strip.width_at(strip.foot) / width_px <= _POST_WIDTH_RATIO:
            return None
        # a post that leaves the view is visible up to the picture's border
        top_px = max(float(top[1]), 0.0) if np.isfinite(top).all() else 0.0
        if strip.foot - strip.bottom > strip.width_at(strip.foot) + _WHITE_STEP:
            return None
        if strip.foot - strip.top < _MIN_POST_RATIO * (strip.foot - top_px):
            return None
        # the top of a post that is higher than the camera is above the horizon, unlike paint on the floor
        if goal.height_m > camera.height_m:
            horizon_px = camera.point_to_pixel(np.array([*axis_m, camera.height_m]))[1]
            if np.isfinite(horizon_px) and strip.top > horizon_px:
                return None
        step = np.diag(_POST_STD_PX)
        own = np.stack([camera.pixel_to_floor(foot_px + row) - foot_m for row in step], axis=1)
        covariance = own @ own.T + shifts @ shifts.T
        if not np.linalg.eigvalsh(covariance)[1] <= MAX_STD_M**2:
            return None
        return Post(float(axis_m[0]), float(axis_m[1]), covariance)


def _is_solid(white: UInt8Array, strip: Strip) -> bool:
    """Whether a strip is about equally bright all over, unlike a net's cords or adjacent objects."""
    rows = np.linspace(strip.top, strip.bottom, 40)
    across = np.array([0.25, 0.5, 0.75])
    left, right = (np.array([at + lean * row for row in rows]) for at, lean in (strip.left, strip.right))
    u = np.rint(left[:, None] + (right - left)[:, None] * across).astype(np.int64)
    v = np.rint(rows).astype(np.int64)[:, None]
    height, width = white.shape
    seen = white[np.clip(v, 0, height - 1), np.clip(u, 0, width - 1)].astype(np.float64)
    return bool(np.percentile(seen, 10) >= _MIN_SOLID_RATIO * np.percentile(seen, 90))
