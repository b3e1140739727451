"""Where the floor samples of a pinhole camera lie in the frame of a camera that is tilted and rolled a little."""

from __future__ import annotations

import numpy as np

from robocup_vision.arrays import FloatArray, Int16Array
from robocup_vision.compiling.loops import compiled


@compiled
def map_pixels(pixels: FloatArray, homography: FloatArray, width: int, height: int, out: Int16Array) -> None:
    """Map pixels by a homography and round them into the frame.

    Parameters
    ----------
    pixels : (K, M, 2) float64
        u and v; NaN where there is none: that becomes 0.
    homography : (3, 3) float64
        Of u, v, 1.
    width, height : int
        Of the frame: what lies beyond becomes the nearest pixel.
    out : (K, M, 2) int16
        Result.
    """
    h = homography
    for k in range(pixels.shape[0]):
        for m in range(pixels.shape[1]):
            u, v = pixels[k, m, 0], pixels[k, m, 1]
            scale = h[2, 0] * u + h[2, 1] * v + h[2, 2]
            if not scale > 0.0:
                out[k, m, 0], out[k, m, 1] = 0, 0
                continue
            x = (h[0, 0] * u + h[0, 1] * v + h[0, 2]) / scale + 0.5
            y = (h[1, 0] * u + h[1, 1] * v + h[1, 2]) / scale + 0.5
            out[k, m, 0] = np.int16(min(max(x, 0.0), width - 1.0))
            out[k, m, 1] = np.int16(min(max(y, 0.0), height - 1.0))
