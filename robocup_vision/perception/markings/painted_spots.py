"""Penalty marks in one frame: white holes in the bare carpet that have a mark's size on the floor."""

from __future__ import annotations

import math

import cv2
import numpy as np

from field_models.field import Field, Mark
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.kernels.lines.ridges import least_of_red_and_blue
from robocup_vision.perception.line_points import LinePoints
from robocup_vision.perception.markings.correlated_errors import FloorErrors
from robocup_vision.perception.markings.marking import MAX_STD_M, PenaltyMark

# margin by which the holes in the bare carpet extend beyond the objects that cause them
_BARE_MARGIN_PX = 4
# directions of the points of a mark's outline
_OUTLINE = np.linspace(0.0, math.tau, 17)[:-1]
# least contrast of white to carpet, grey levels, and least fraction of the greatest for a pixel to count
_MIN_CONTRAST, _MIN_RATIO = 30.0, 0.15
# standard deviation of the lens' blur, pixels
_BLUR_PX = 0.8
# smallest width or height of a mark in the picture: smaller ones cannot be distinguished from dirt
_MIN_SIZE_PX = 5.0
# largest ratio of a mark's size to the expected one, and its inverse the smallest; error of a size in whole pixels
_SIZE_RATIO, _SLACK_PX = 1.5, 2.0
# standard deviation of a mark's middle in the picture
_STD_PX = 0.12


class SpotFinder:
    """Finds the penalty marks of a field."""

    def __init__(self, field: Field) -> None:
        self._mark = field.marks[0] if field.marks else None
        if self._mark is not None:
            self._area_m2, self._spread_m2 = _area_and_spread(self._mark, field.line_width_m)

    def find(self, frame: UInt8Array, points: LinePoints, errors: FloorErrors) -> list[PenaltyMark]:
        """Return the marks in a frame (H, W, 3) uint8 BGR, the most accurate first."""
        if self._mark is None or points.bare_floor is None:
            return []
        hidden = np.asarray(~points.bare_floor, dtype=np.uint8)
        count, _, stats, middles = cv2.connectedComponentsWithStats(hidden, connectivity=8)
        places = errors.camera.pixel_to_floor(middles)
        found = []
        for number in range(1, count):
            box = [int(value) for value in stats[number, :4]]
            if not np.isfinite(places[number]).all() or not self._is_as_large(box, places[number], errors):
                continue
            mark = self._measured(frame, box, errors)
            if mark is not None:
                found.append(mark)
        return sorted(found, key=lambda one: float(np.trace(one.covariance)))

    def _is_as_large(self, box: list[int], place_m: FloatArray, errors: FloorErrors) -> bool:
        """Whether a hole in the bare carpet has the size of a mark there."""
        assert self._mark is not None
        rim_m = place_m + self._mark.size_m / 2 * np.stack([np.cos(_OUTLINE), np.sin(_OUTLINE)], axis=1)
        rim_px = errors.camera.floor_to_pixel(rim_m)
        if not np.isfinite(rim_px).all():
            return False
        size_px = np.ptp(rim_px, axis=0)
        own_px = np.array(box[2:]) - 2 * _BARE_MARGIN_PX
        least_px, most_px = size_px / _SIZE_RATIO - _SLACK_PX, _SIZE_RATIO * size_px + _SLACK_PX
        return bool(size_px.max() >= _MIN_SIZE_PX and ((own_px >= least_px) & (own_px <= most_px)).all())

    def _measured(self, frame: UInt8Array, box: list[int], errors: FloorErrors) -> PenaltyMark | None:
        """Return the mark in a box of the picture; None if it is none."""
        camera = errors.camera
        left, top, width, height = box
        window = np.ascontiguousarray(frame[top : top + height, left : left + width])
        if min(window.shape[:2]) < 3 or 0 in (left, top):
            return None
        white = np.empty(window.shape[:2], dtype=np.uint8)
        least_of_red_and_blue(window, white)
        level = white.astype(np.float64)
        carpet = float(np.median(np.concatenate([level[0], level[-1], level[:, 0], level[:, -1]])))
        contrast = float(np.percentile(level, 100 * (1 - 4 / level.size))) - carpet
        if contrast < _MIN_CONTRAST:
            return None
        paint = (level - carpet) / contrast
        paint = np.where(paint >= _MIN_RATIO, np.minimum(paint, 1.0), 0.0)
        v, u = np.mgrid[top : top + height, left : left + width].astype(np.float64)
        floor = camera.pixel_to_floor(np.stack([u, v], axis=-1))
        if not np.isfinite(floor).all():
            return None
        by_v, by_u = np.gradient(floor, axis=0), np.gradient(floor, axis=1)
        # weighted by floor area, so that perspective does not move the middle
        weight = paint * np.abs(by_u[..., 0] * by_v[..., 1] - by_u[..., 1] * by_v[..., 0])
        area = float(weight.sum())
        place = np.einsum("vu,vui->i", weight, floor) / area
        off = floor - place
        spread = np.einsum("vu,vui,vuj->ij", weight, off, off) / area
        per_px = np.stack([by_u[height // 2, width // 2], by_v[height // 2, width // 2]], axis=1)
        blur = _BLUR_PX**2 * per_px @ per_px.T
        expected = self._spread_m2 * np.eye(2) + blur
        lengths = np.sqrt(np.linalg.eigvals(np.linalg.solve(expected, spread)).real)
        is_one = lengths.min() >= 1 / _SIZE_RATIO and lengths.max() <= _SIZE_RATIO
        if not is_one or not 1 / _SIZE_RATIO**2 <= area / self._area_m2 <= _SIZE_RATIO**2:
            return None
        shifts = errors.shifts_m(camera.floor_to_pixel(place))
        covariance = _STD_PX**2 * per_px @ per_px.T + shifts @ shifts.T
        if not np.linalg.eigvalsh(covariance)[1] <= MAX_STD_M**2:
            return None
        return PenaltyMark(float(place[0]), float(place[1]), covariance)


def _area_and_spread(mark: Mark, line_width_m: float) -> tuple[float, float]:
    """Return a mark's painted area, square metres, and the variance of its paint along either axis."""
    size, width = mark.size_m, line_width_m
    if mark.kind == "dot":
        return math.pi / 4 * size**2, size**2 / 16
    area = 2 * size * width - width**2
    # two strokes minus their common square
    return area, (size * width * (size**2 + width**2) - width**4) / (12 * area)
