"""What line points err by alike over some length: paint, light and lens move stretches of line, not single points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.perception.line_points import LinePoints
from robocup_vision.perception.markings.settings import MarkingSettings
from robocup_vision.perception.markings.straight import Straight, scale_m

# points in one square of the picture, so many pixels wide, err alike
_SQUARE_PX = 24.0
# stripes of fewer points tell nothing
_MIN_POINTS = 4
# of the square of a standard normal number
_MEDIAN_CHI2 = 0.4549


def slow_error_px(points: LinePoints, lines: list[Straight], settings: MarkingSettings) -> float:
    """Return the standard deviation of what neighbouring points err by alike, pixels across the line.

    It is what the means of straight lines' points, stripe by stripe, differ by beyond what single points' errors make
    of them, but no less than `settings.bias_px`.
    """
    squared, single = [np.empty(0)], [np.empty(0)]
    for line in lines:
        which = line.points
        residual_px = (points.floor_m[which] @ line.normal - line.distance_m) / scale_m(points, which, line.normal)
        # cut along the line: cut across, its halves would err either way
        pixels = points.pixels[which]
        stripe = _squares(pixels[:, [int(np.ptp(pixels, axis=0).argmax())]])
        number = np.bincount(stripe).astype(np.float64)
        full = number >= _MIN_POINTS
        # the fit of a line takes two of the means
        left = np.count_nonzero(full) - 2
        if left < 1:
            continue
        mean = np.bincount(stripe, residual_px) / number
        within = float(((residual_px - mean[stripe]) ** 2).sum()) / max(len(which) - len(number), 1)
        squared.append(mean[full] ** 2 * (left + 2) / left)
        single.append(settings.points_per_sample * within / number[full])
    if len(squared) == 1:
        return settings.bias_px
    excess = float(np.median(np.concatenate(squared))) / _MEDIAN_CHI2 - float(np.median(np.concatenate(single)))
    return float(np.sqrt(max(excess, settings.bias_px**2)))


def with_slow_errors(points: LinePoints, line: Straight, slow_px: float) -> Straight:
    """Return a stretch of line with the errors that its points have alike, see `slow_covariance`."""
    which = line.points
    scale = scale_m(points, which, line.normal)
    weight = points.weight[which] / scale**2
    off = points.floor_m[which] @ line.along - line.middle_m
    turn = -weight * off * scale / max(float(weight @ off**2), 1e-12)
    gain = np.stack([turn, weight * scale / weight.sum() + line.middle_m * turn])
    return replace(line, covariance=line.covariance + slow_covariance(gain, points.pixels[which], slow_px))


def slow_covariance(gain: FloatArray, pixels: FloatArray, slow_px: float | FloatArray) -> FloatArray:
    """Return the covariance (S, S) of a fit by what its points err by alike.

    Parameters
    ----------
    gain : (S, P) float64
        By how much an error of each point, in pixels across its line, moves what is fitted.
    pixels : (P, 2) float64
        Of the points.
    slow_px : float or (P,) float64
        All points err by so much together, and those of each square of the picture by as much again.
    """
    square = _squares(pixels)
    by_square = np.stack([np.bincount(square, row) for row in gain * slow_px])
    together = by_square.sum(axis=1)
    return np.asarray(np.outer(together, together) + by_square @ by_square.T)


def _squares(pixels: FloatArray) -> Int64Array:
    """(P,) int64: in which square of the picture, or stripe, each of some pixels (P, 2 or 1) lies, counted from 0."""
    at = np.floor(pixels / _SQUARE_PX).astype(np.int64)
    return np.asarray(np.unique(at, axis=0, return_inverse=True)[1].ravel(), dtype=np.int64)
