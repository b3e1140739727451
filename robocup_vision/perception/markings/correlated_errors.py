"""Correlated errors of floor places: of the camera's attitude, and of stretches of line.

The camera's attitude has a limited accuracy, and its error moves all places together. Paint, light and lens move
stretches of line.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.perception.line_points import LinePoints
from robocup_vision.perception.markings.straight import POINTS_PER_SAMPLE, Straight, scale_m

# side of a square of the picture whose points have correlated errors
_SQUARE_PX = 24.0
# least number of points in a stripe whose mean is used
_MIN_POINTS = 4
# median of the square of a standard normal number
_MEDIAN_CHI2 = 0.4549
# least common error of whole stretches of line, due to lens, light and paint
_BIAS_PX = 0.02


@dataclass(frozen=True, eq=False)
class FloorErrors:
    """A camera, and the errors of its attitude, height, focal length and pan."""

    camera: OmniCamera | PinholeCamera  #: attitude as measured by the frame
    #: (5, K) float64: one column for each independent error, of one standard deviation, in a forward camera's tilt,
    #: roll, height, logarithm of the focal length and pan, rad and m. (0, 0) for a mirror camera, taken as exact.
    root: FloatArray

    @classmethod
    def of(
        cls,
        camera: OmniCamera | PinholeCamera,
        held_covariance: FloatArray | None = None,
    ) -> FloorErrors:
        """Return the errors of a camera whose attitude is measured by a frame or given by its file.

        Parameters
        ----------
        camera : OmniCamera or PinholeCamera
            The camera at that attitude.
        held_covariance : (4, 4) float64, optional
            Covariance of a forward camera's tilt, roll, height and logarithm of the focal length.
        """
        if isinstance(camera, OmniCamera):
            return cls(camera, np.empty((0, 0)))
        covariance = np.zeros((5, 5))
        if held_covariance is None:
            focal_std = camera.focal_std_px / math.sqrt(camera.focal_px[0] * camera.focal_px[1])
            stds = np.array([*camera.sway_std_rad, camera.height_std_m, focal_std])
            held_covariance = np.diag(stds**2)
        covariance[:4, :4], covariance[4, 4] = held_covariance, camera.pan_std_rad**2
        return cls(camera, _root(covariance))

    @cached_property
    def _others(self) -> tuple[tuple[PinholeCamera, PinholeCamera], ...]:
        """The camera with each error of plus and of minus one standard deviation."""
        camera = self.camera
        if isinstance(camera, OmniCamera):
            return ()
        return tuple((_held(camera, column), _held(camera, -column)) for column in self.root.T)

    def moved(self, deviations: FloatArray) -> FloorErrors:
        """Return the errors relative to the camera with these deviations (K,), in standard deviations."""
        if isinstance(self.camera, OmniCamera):
            return self
        return FloorErrors(_held(self.camera, self.root @ deviations), self.root)

    def shifts_m(self, pixels: FloatArray) -> FloatArray:
        """Return the shifts of pixels' (..., 2) floor places by one standard deviation of each error, (..., 2, K), m.

        Computed as central differences. NaN where a pixel may be beyond the horizon.
        """
        shifts = [(more.pixel_to_floor(pixels) - less.pixel_to_floor(pixels)) / 2 for more, less in self._others]
        return np.stack(shifts, axis=-1) if shifts else np.empty((*np.shape(pixels), 0))


def _root(covariance: FloatArray) -> FloatArray:
    """Return a root (N, K) of a covariance (N, N): the Cholesky factor, without the columns of exact parameters."""
    errs = np.diag(covariance) > 0.0
    root = np.zeros_like(covariance)
    root[np.ix_(errs, errs)] = np.linalg.cholesky(covariance[np.ix_(errs, errs)])
    return root[:, errs]


def _held(camera: PinholeCamera, error: FloatArray) -> PinholeCamera:
    tilt, roll, height, log_focal, pan = error.tolist()
    (fu, fv), scale = camera.focal_px, math.exp(log_focal)
    panned = camera.with_orientation((camera.pan_rad or 0.0) + pan, camera.tilt_rad, camera.roll_rad)
    return panned.as_fitted(
        (camera.tilt_rad or 0.0) + tilt,
        (camera.roll_rad or 0.0) + roll,
        # must stay above the floor
        max(camera.height_m + height, 0.1 * camera.height_m),
        (fu * scale, fv * scale),
    )


def common_error_px(points: LinePoints, lines: list[Straight]) -> float:
    """Return the standard deviation of the common error of neighbouring points, pixels across the line.

    The points of each straight line are averaged in stripes. The excess of the means' scatter about the line over the
    points' own errors is the common error. It is at least 0.02 pixels.
    """
    squared, single = [np.empty(0)], [np.empty(0)]
    for line in lines:
        which = line.points
        residual_px = (points.floor_m[which] @ line.normal - line.distance_m) / scale_m(points, which, line.normal)
        # stripes divide the line's length; dividing its width would bias the halves
        pixels = points.pixels[which]
        stripe = _squares(pixels[:, [int(np.ptp(pixels, axis=0).argmax())]])
        number = np.bincount(stripe).astype(np.float64)
        full = number >= _MIN_POINTS
        # a line has two parameters
        left = np.count_nonzero(full) - 2
        if left < 1:
            continue
        mean = np.bincount(stripe, residual_px) / number
        within = float(((residual_px - mean[stripe]) ** 2).sum()) / max(len(which) - len(number), 1)
        squared.append(mean[full] ** 2 * (left + 2) / left)
        single.append(POINTS_PER_SAMPLE * within / number[full])
    if len(squared) == 1:
        return _BIAS_PX
    excess = float(np.median(np.concatenate(squared))) / _MEDIAN_CHI2 - float(np.median(np.concatenate(single)))
    return float(np.sqrt(max(excess, _BIAS_PX**2)))


def with_common_errors(points: LinePoints, line: Straight, common_px: float) -> Straight:
    """Return a stretch of line with its points' common errors added to its covariance, see `common_covariance`."""
    which = line.points
    scale = scale_m(points, which, line.normal)
    weight = points.weight[which] / scale**2
    off = points.floor_m[which] @ line.along - line.middle_m
    turn = -weight * off * scale / max(float(weight @ off**2), 1e-12)
    gain = np.stack([turn, weight * scale / weight.sum() + line.middle_m * turn])
    return replace(line, covariance=line.covariance + common_covariance(gain, points.pixels[which], common_px))


def common_covariance(gain: FloatArray, pixels: FloatArray, common_px: float | FloatArray) -> FloatArray:
    """Return the covariance (S, S) of a fit due to the common errors of its points.

    Parameters
    ----------
    gain : (S, P) float64
        Derivative of the fitted parameters by each point's error across its line, pixels.
    pixels : (P, 2) float64
        Pixels of the points.
    common_px : float or (P,) float64
        Standard deviation of an error that all points share, and of another that those of each square of the picture
        share.
    """
    square = _squares(pixels)
    by_square = np.stack([np.bincount(square, row) for row in gain * common_px])
    together = by_square.sum(axis=1)
    return np.asarray(np.outer(together, together) + by_square @ by_square.T)


def _squares(pixels: FloatArray) -> Int64Array:
    """Return the index (P,) int64 of the square, or stripe, of each pixel (P, 2 or 1), counted from 0."""
    at = np.floor(pixels / _SQUARE_PX).astype(np.int64)
    return np.asarray(np.unique(at, axis=0, return_inverse=True)[1].ravel(), dtype=np.int64)
