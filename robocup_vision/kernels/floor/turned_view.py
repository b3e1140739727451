"""Where the floor samples of a pinhole camera lie in the frame of a camera that is tilted and rolled a little."""

from __future__ import annotations

import numpy as np

from robocup_vision.arrays import Float32Array, FloatArray
from robocup_vision.compiling.loops import compiled


@compiled(error_model="numpy")
def map_pixels(planes: Float32Array, homography: FloatArray, width: int, height: int, out: Float32Array) -> None:
    """Map pixels by a homography, into the frame.

    Nothing in the loop branches, and u and v lie apart, so that several pixels are mapped at once.

    Parameters
    ----------
    planes : (2, K, M) float32
        u and v; NaN where there is none: that becomes 0.
    homography : (3, 3) float64
        Of u, v, 1.
    width, height : int
        Of the frame: what lies beyond is moved to its rim.
    out : (2, K, M) float32
        Result.
    """
    # in variables: what is written might be the homography's memory, for all the compiler knows
    a, b, c = np.float32(homography[0, 0]), np.float32(homography[0, 1]), np.float32(homography[0, 2])
    d, e, f = np.float32(homography[1, 0]), np.float32(homography[1, 1]), np.float32(homography[1, 2])
    g, h, i = np.float32(homography[2, 0]), np.float32(homography[2, 1]), np.float32(homography[2, 2])
    right, low, none, one = np.float32(width - 1), np.float32(height - 1), np.float32(0.0), np.float32(1.0)
    for k in range(planes.shape[1]):
        for m in range(planes.shape[2]):
            u, v = planes[0, k, m], planes[1, k, m]
            scale = g * u + h * v + i
            by_scale = one / scale
            x, y = (a * u + b * v + c) * by_scale, (d * u + e * v + f) * by_scale
            is_ahead = scale > none
            x = x if is_ahead & (x > none) else none
            y = y if is_ahead & (y > none) else none
            out[0, k, m] = x if x < right else right
            out[1, k, m] = y if y < low else low
