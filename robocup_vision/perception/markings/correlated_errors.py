"""Errors that the floor places of a frame's pixels have in common: of the camera's attitude, and of stretches of line.

How the camera is held is known with limited accuracy and moves all places together. Paint, light and lens move
stretches of line, not single points.
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
from robocup_vision.perception.markings.marking import MarkingSettings
from robocup_vision.perception.markings.straight import Straight, scale_m

# width of a square of the picture whose points have correlated errors
_SQUARE_PX = 24.0
# the mean of a stripe of fewer points is not used
_MIN_POINTS = 4
# median of the square of a standard normal number
_MEDIAN_CHI2 = 0.4549


@dataclass(frozen=True, eq=False)
class FloorErrors:
    """A camera, and the errors of its attitude, height, focal length and pan."""

    camera: OmniCamera | PinholeCamera  #: as the frame shows it to be held
    #: (5, K) float64: columns are independent errors, each by one standard deviation: of a forward camera's tilt, roll,
    #: height, logarithm of the focal length and pan, rad and m. (0, 0): a mirror camera's file is taken to be right.
    root: FloatArray

    @classmethod
    def of(
        cls,
        camera: OmniCamera | PinholeCamera,
        settings: MarkingSettings,
        held_covariance: FloatArray | None = None,
    ) -> FloorErrors:
        """Return the errors of a camera whose attitude a frame has shown, or else its file gives.

        Parameters
        ----------
        camera : OmniCamera or PinholeCamera
            As the frame, or else its file, says that it is held.
        settings : MarkingSettings
            Standard deviations that are assumed where neither gives them.
        held_covariance : (4, 4) float64, optional
            Of a forward camera's tilt, roll, height and logarithm of the focal length.
        """
        if isinstance(camera, OmniCamera):
            return cls(camera, np.empty((0, 0)))
        covariance = np.zeros((5, 5))
        if held_covariance is None:
            focal_std = camera.focal_std_px / math.sqrt(camera.focal_px[0] * camera.focal_px[1])
            stds = np.array([*camera.sway_std_rad(settings.sway_std_rad), camera.height_std_m, focal_std])
            held_covariance = np.diag(stds**2)
        covariance[:4, :4], covariance[4, 4] = held_covariance, camera.pan_std_rad**2
        return cls(camera, _root(covariance))

    @cached_property
    def _others(self) -> tuple[tuple[PinholeCamera, PinholeCamera], ...]:
        """The camera off by each error either way, one at a time."""
        camera = self.camera
        if isinstance(camera, OmniCamera):
            return ()
        return tuple((_held(camera, column), _held(camera, -column)) for column in self.root.T)

    def moved(self, deviations: FloatArray) -> FloorErrors:
        """Return the errors about the camera that is off by so many (K,) standard deviations of each."""
        if isinstance(self.camera, OmniCamera):
            return self
        return FloorErrors(_held(self.camera, self.root @ deviations), self.root)

    def shifts_m(self, pixels: FloatArray) -> FloatArray:
        """How far floor places of pixels (..., 2) move by one standard deviation of each error, (..., 2, K), metres.

        A central difference: half of the way from the place at minus one deviation to that at plus one. NaN where a
        pixel may be beyond the horizon.
        """
        shifts = [(more.pixel_to_floor(pixels) - less.pixel_to_floor(pixels)) / 2 for more, less in self._others]
        return np.stack(shifts, axis=-1) if shifts else np.empty((*np.shape(pixels), 0))


def _root(covariance: FloatArray) -> FloatArray:
    """Return a root (N, K) of a covariance (N, N), lower triangular but for the columns of what does not err."""
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
        # a camera is above the floor
        max(camera.height_m + height, 0.1 * camera.height_m),
        (fu * scale, fv * scale),
    )


def common_error_px(points: LinePoints, lines: list[Straight], settings: MarkingSettings) -> float:
    """Return the standard deviation of the error that neighbouring points have in common, pixels across the line.

    The points of each straight line are averaged stripe by stripe. The means scatter about the line by more than the
    points' own errors explain; the excess is the common error. It is no less than `settings.bias_px`.
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


def with_common_errors(points: LinePoints, line: Straight, common_px: float) -> Straight:
    """Return a stretch of line whose covariance holds its points' common errors, see `common_covariance`."""
    which = line.points
    scale = scale_m(points, which, line.normal)
    weight = points.weight[which] / scale**2
    off = points.floor_m[which] @ line.along - line.middle_m
    turn = -weight * off * scale / max(float(weight @ off**2), 1e-12)
    gain = np.stack([turn, weight * scale / weight.sum() + line.middle_m * turn])
    return replace(line, covariance=line.covariance + common_covariance(gain, points.pixels[which], common_px))


def common_covariance(gain: FloatArray, pixels: FloatArray, common_px: float | FloatArray) -> FloatArray:
    """Return the covariance (S, S) of a fit by the errors that its points have in common.

    Parameters
    ----------
    gain : (S, P) float64
        By how much an error of each point, in pixels across its line, moves what is fitted.
    pixels : (P, 2) float64
        Of the points.
    common_px : float or (P,) float64
        Standard deviation of an error common to all points, and of another common to those of each square of the
        picture.
    """
    square = _squares(pixels)
    by_square = np.stack([np.bincount(square, row) for row in gain * common_px])
    together = by_square.sum(axis=1)
    return np.asarray(np.outer(together, together) + by_square @ by_square.T)


def _squares(pixels: FloatArray) -> Int64Array:
    """(P,) int64: in which square of the picture, or stripe, each of some pixels (P, 2 or 1) lies, counted from 0."""
    at = np.floor(pixels / _SQUARE_PX).astype(np.int64)
    return np.asarray(np.unique(at, axis=0, return_inverse=True)[1].ravel(), dtype=np.int64)
