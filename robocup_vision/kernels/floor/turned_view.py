"""A frame's samples by a pinhole camera that is tilted and rolled a little from where their places are known."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import Float32Array, FloatArray, Int64Array, UInt8Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.pinhole import camera_axes

Pair = tuple[float, float]
# added to a number of a few digits and taken off again it rounds it to the nearest whole one
_ROUNDS = np.float32(1.5 * 2**23)


@compiled(error_model="numpy")
def map_turn(before_rad: Pair, after_rad: Pair, focal_px: Pair, center_px: Pair, out: FloatArray) -> None:
    """Write the homography (3, 3) of a camera that is turned about its viewpoint, from pixels before to those after.

    Parameters
    ----------
    before_rad, after_rad : (float, float)
        Tilt and roll.
    focal_px, center_px : (float, float)
        Along u and v.
    out : (3, 3) float64
        Result: of u, v, 1.
    """
    before = camera_axes(0.0, before_rad[0], before_rad[1])
    after = camera_axes(0.0, after_rad[0], after_rad[1])
    (fu, fv), (cu, cv) = focal_px, center_px
    for row in range(3):
        for column in range(3):
            out[row, column] = 0.0
    # the world's axes one by one: what of each lies before the turn along a pixel's ray, and after it
    for axis in range(3):
        ahead, left, up = before[axis]
        ray = -left / fu, -up / fv, ahead + left * cu / fu + up * cv / fv
        ahead, left, up = after[axis]
        pixel = cu * ahead - fu * left, cv * ahead - fv * up, ahead
        for row in range(3):
            for column in range(3):
                out[row, column] += pixel[row] * ray[column]


@compiled
def place_on_floor(
    columns: Int64Array,
    distance_m: FloatArray,
    first_rad: float,
    step_rad: float,
    foot_m: Pair,
    seen: int,
    out: FloatArray,
) -> None:
    """Write where one sample of each bearing lies on the floor, robot frame.

    Parameters
    ----------
    columns : (K,) int64
        The sample of each bearing; M where none.
    distance_m : (M,) float64
        Of the columns from the camera's foot; NaN from the horizon on.
    first_rad, step_rad : float
        First bearing, and from one to the next.
    foot_m : (float, float)
        The camera's foot.
    seen : int
        Bearings in view; those behind them have no place.
    out : (K, 2) float64
        Result; NaN where there is none.
    """
    for k in range(out.shape[0]):
        bearing = first_rad + k * step_rad
        distance = distance_m[columns[k]] if k < seen and columns[k] < distance_m.shape[0] else math.nan
        out[k, 0], out[k, 1] = foot_m[0] + distance * math.cos(bearing), foot_m[1] + distance * math.sin(bearing)


@compiled(error_model="numpy")
def sample_turned(frame: UInt8Array, planes: Float32Array, homography: FloatArray, out: UInt8Array) -> None:
    """Map pixels by a homography, into the frame, and write the colours of the nearest ones there.

    Places are worked out a row before its colours are fetched: nothing there branches, and u and v lie apart, so that
    several are worked out at once.

    Parameters
    ----------
    frame : (H, W, 3) uint8
        What lies beyond is moved to its rim.
    planes : (2, K, M) float32
        u and v; NaN where there is none: that becomes 0.
    homography : (3, 3) float64
        Of u, v, 1.
    out : (K, M, 3) uint8
        Result.
    """
    # in variables: what is written might be the homography's memory, for all the compiler knows
    a, b, c = np.float32(homography[0, 0]), np.float32(homography[0, 1]), np.float32(homography[0, 2])
    d, e, f = np.float32(homography[1, 0]), np.float32(homography[1, 1]), np.float32(homography[1, 2])
    g, h, i = np.float32(homography[2, 0]), np.float32(homography[2, 1]), np.float32(homography[2, 2])
    height, width = frame.shape[:2]
    right, low, none, one = np.float32(width - 1), np.float32(height - 1), np.float32(0.0), np.float32(1.0)
    across = np.int32(3 * width)
    flat = frame.reshape(-1)
    rows, columns = planes.shape[1:]
    at = np.empty(columns, np.int32)
    for k in range(rows):
        for m in range(columns):
            u, v = planes[0, k, m], planes[1, k, m]
            scale = g * u + h * v + i
            by_scale = one / scale
            x, y = (a * u + b * v + c) * by_scale, (d * u + e * v + f) * by_scale
            is_ahead = scale > none
            x = x if is_ahead & (x > none) else none
            y = y if is_ahead & (y > none) else none
            x = x if x < right else right
            y = y if y < low else low
            x, y = (x + _ROUNDS) - _ROUNDS, (y + _ROUNDS) - _ROUNDS
            at[m] = np.int32(y) * across + np.int32(3) * np.int32(x)
        for m in range(columns):
            # unsigned: a signed index would be checked for being negative at every access
            place = np.uint32(at[m])
            out[k, m, 0] = flat[place]
            out[k, m, 1] = flat[place + np.uint32(1)]
            out[k, m, 2] = flat[place + np.uint32(2)]
