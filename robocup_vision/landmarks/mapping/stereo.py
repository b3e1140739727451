"""Matches features of three images and triangulates them, with covariances (Ogawa et al. 2011, eqs. 3 to 6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.landmarks.features import PIXEL_STD_PER_SPACING, Features, match
from robocup_vision.landmarks.mapping.run_files import TrinocularRig

# greatest distance from the epipolar line, and greatest difference of both disparities, in standard deviations
_MAX_DEVIATION = 3.0
# greatest ratio of two features' sizes: the paper's "within one level of scale"; levels of an octave differ by 2^(1/3)
_MAX_SCALE_RATIO = 2.0 ** (1.0 / 3.0) * 1.05
_MIN_DEPTH_M = 0.25  # least depth of a point, which bounds the disparity


@dataclass(frozen=True, slots=True, eq=False)
class StereoPoints:
    """Features of the right image that were matched in both other images, with their positions."""

    index: Int64Array  #: (N,) int64: indices of these features in the right image
    features: Features  #: the N features of the right image
    #: (N, 4) float64: u and v in the right image, u in the left, v in the upper
    measured_px: FloatArray
    std_px: FloatArray  #: (N,) float64: standard deviation of each of these coordinates
    points_m: FloatArray  #: (N, 3) float64: positions in the right camera's frame (eq. 4)
    covariances: FloatArray  #: (N, 3, 3) float64: covariances of the positions (eq. 6)

    def __len__(self) -> int:
        return len(self.points_m)

    def take(self, which: npt.NDArray[np.intp] | Int64Array) -> StereoPoints:
        """Return some of them, in this order."""
        numbers = (self.measured_px, self.std_px, self.points_m, self.covariances)
        return StereoPoints(self.index[which], self.features.take(which), *(array[which] for array in numbers))


def correspond(rig: TrinocularRig, right: Features, left: Features, top: Features) -> StereoPoints:
    """Match the features of three simultaneous images, and triangulate them.

    In the left and in the upper image a match lies on the epipolar line, is within one level of scale and passes the
    ratio test. Both disparities must agree.
    """
    std_r, std_l, std_t = (PIXEL_STD_PER_SPACING * f.spacing_px for f in (right, left, top))
    fx, fy = rig.right.focal_px
    max_u, max_v = (focal_px * rig.baseline_m / _MIN_DEPTH_M for focal_px in (fx, fy))

    def allowed(
        other: Features, std: FloatArray, along: int, most: float
    ) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        tolerance = _MAX_DEVIATION * np.hypot(std_r[:, None], std[None, :])
        shift = other.pixels[None, :, along] - right.pixels[:, None, along]
        off = np.abs(other.pixels[None, :, 1 - along] - right.pixels[:, None, 1 - along])
        scale = np.abs(np.log(other.size_px[None, :] / right.size_px[:, None])) <= np.log(_MAX_SCALE_RATIO)
        return np.asarray((off <= tolerance) & (shift > 0) & (shift <= most) & scale)

    in_left = np.full(len(right), -1)
    rows, partners = match(right.descriptors, left.descriptors, allowed(left, std_l, 0, max_u))
    in_left[rows] = partners
    in_top = np.full(len(right), -1)
    rows, partners = match(right.descriptors, top.descriptors, allowed(top, std_t, 1, max_v))
    in_top[rows] = partners
    both = np.flatnonzero((in_left >= 0) & (in_top >= 0))
    by_u = (left.pixels[in_left[both], 0] - right.pixels[both, 0]) / fx
    by_v = (top.pixels[in_top[both], 1] - right.pixels[both, 1]) / fy
    std = np.sqrt((std_r[both] ** 2 + std_l[in_left[both]] ** 2 + std_t[in_top[both]] ** 2) / 3)
    agree = np.abs(by_u - by_v) <= _MAX_DEVIATION * 2 * std / min(fx, fy)
    both, std = both[agree], std[agree]
    measured = np.column_stack([right.pixels[both], left.pixels[in_left[both], 0], top.pixels[in_top[both], 1]])
    points, covariances = place(rig, measured, std)
    return StereoPoints(both, right.take(both), measured, std, points, covariances)


def place(rig: TrinocularRig, measured_px: FloatArray, std_px: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return points (N, 3), right camera's frame, and covariances (N, 3, 3), of measurements (N, 4) (eqs. 4 to 6)."""
    (fx, fy), (cu, cv) = rig.right.focal_px, rig.right.center_px
    u, v, u_left, v_top = measured_px.T
    disparity = ((u_left - u) / fx + (v_top - v) / fy) / 2
    depth = rig.baseline_m / disparity
    sx, sy = (u - cu) / fx, (v - cv) / fy
    points = np.stack([depth, -sx * depth, -sy * depth], axis=-1)
    # derivatives by u and v in the right image, u in the left, v in the upper
    of_disparity = np.array([-0.5 / fx, -0.5 / fy, 0.5 / fx, 0.5 / fy])
    direction = np.stack([np.ones_like(sx), -sx, -sy], axis=-1)
    jacobian = direction[:, :, None] * (-depth / disparity)[:, None, None] * of_disparity
    jacobian[:, 1, 0] -= depth / fx
    jacobian[:, 2, 1] -= depth / fy
    return points, (jacobian @ jacobian.transpose(0, 2, 1)) * (std_px**2)[:, None, None]
