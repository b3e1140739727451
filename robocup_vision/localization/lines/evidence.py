"""Log-likelihood ratio of a pose by line points: points of painted lines among clutter, against clutter alone.

A point of clutter lies near a line by chance, with a probability that follows from the camera and the density of the
field's lines: a few pixels cover little floor near the robot, and reach from line to line far away. An unknown fraction
of the points on the carpet is of lines; the rest is clutter, such as other robots. Points in one patch of floor have
common errors and count as one. Some pose puts any straight edge on a line, so the line with the most evidence is not
counted.
"""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import BoolArray, FloatArray
from robocup_vision.geometry import Pose2
from robocup_vision.localization.lines.fit import residuals_of, seen_points
from robocup_vision.localization.lines.line_map import LineMap
from robocup_vision.localization.lines.search import NOISE_PX, POINTS_PER_PATCH, patches
from robocup_vision.perception.line_points import LinePoints

# greatest fraction of points on lines, and bounds of the probability of chance: fields and cameras are not known better
_MAX_RATIO, _CHANCE = 0.98, (1e-3, 1.0 - 1e-6)


class LinePointEvidence:
    """Weighs poses by the line points of one frame.

    A point is on a line no farther from it than the search's noise, across the line in the image.
    """

    def __init__(self, points: LinePoints, line_map: LineMap) -> None:
        points = line_map.within_reach(points)
        self._map, self._seen, self._near_px = line_map, seen_points(points, line_map), NOISE_PX
        member, _, count = patches(points.floor_m)
        total = np.bincount(member, points.weight, len(count))
        full = np.minimum(1.0, count / POINTS_PER_PATCH)
        self._weight: FloatArray = points.weight * (full / np.maximum(total, 1e-9))[member]
        metres_per_px = np.sqrt(points.floor_per_px2)
        # expected number of lines near a point, if the field's lines were anywhere with their usual density
        expected = 2 * self._near_px * metres_per_px * line_map.lines_per_m
        self._chance: FloatArray = np.clip(1.0 - np.exp(-expected), *_CHANCE)

    def log_odds(self, pose: Pose2) -> float:
        """Return the log-likelihood ratio of a pose; at least 0."""
        rows = residuals_of(pose, self._seen)
        is_on_line = rows.residual <= self._near_px
        if not is_on_line.any():
            return 0.0
        counts = self._map.counts(pose.transform(self._seen.floor_m), is_on_line)
        weight, chance, on_line = self._weight[counts], self._chance[counts], is_on_line[counts]
        line, gain = rows.nearest[counts], _gain(weight, chance, on_line)
        richest = int(np.bincount(line[on_line], gain[on_line]).argmax())
        rest = ~(on_line & (line == richest))
        return max(float(_gain(weight[rest], chance[rest], on_line[rest]).sum()), 0.0)


def _gain(weight: FloatArray, chance: FloatArray, on_line: BoolArray) -> FloatArray:
    """Return the log-likelihood ratio (N,) of each point, with the most likely fraction of points on lines."""
    free = float(weight @ (1.0 - chance))
    if not free > 0.0:
        return np.zeros(len(weight))
    ratio = min(max(float(weight @ (on_line - chance)) / free, 0.0), _MAX_RATIO)
    return np.asarray(weight * np.where(on_line, np.log1p(ratio * (1.0 - chance) / chance), math.log1p(-ratio)))
