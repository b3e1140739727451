"""White goal paint in a picture: its least channel, carpet's greenness, and bright runs between two steep edges."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int16Array, Int64Array, UInt8Array
from robocup_vision.compiling.loops import compiled, variable

# gradients are whole eighths of a grey level, and there are so many sizes of them
GRADIENTS_PER_LEVEL = 8
GRADIENT_SIZES = 3 * 255 + 1
# falls that end a run, after each rise
RUNS_PER_RISE = 3


class WhiteRuns(NamedTuple):
    """Runs of white paint: row, left and right end, and contrast, (N,) float64 each, with room for all there may be."""

    row: FloatArray
    left: FloatArray
    right: FloatArray
    contrast: FloatArray


@compiled
def least_channel(image: UInt8Array, least: UInt8Array) -> None:
    """Set (H, W) uint8 to the least of each pixel's channels, of (H, W, 3) uint8: white paint is bright in all."""
    # by places in one row: loops over three indices are not vectorised
    flat, out = image.reshape(-1), least.reshape(-1)
    for i in range(out.shape[0]):
        out[i] = min(min(flat[3 * i], flat[3 * i + 1]), flat[3 * i + 2])


@compiled
def greenness(image: UInt8Array, green: UInt8Array) -> None:
    """Set (H, W) uint8 to what green has more than the mean of red and blue, of (H, W, 3) uint8; 0 where it has less.

    Means that end in a half are rounded to even.
    """
    flat, out = image.reshape(-1), green.reshape(-1)
    for i in range(out.shape[0]):
        both = np.int16(flat[3 * i]) + np.int16(flat[3 * i + 2])
        mean = np.int16(both >> 1)
        mean = np.int16(mean + (both & mean & 1))
        out[i] = max(np.int16(np.int16(flat[3 * i + 1]) - mean), np.int16(0))


@compiled
def band_gradients(least: UInt8Array, row_step: int, gradient: Int16Array, sizes: Int64Array) -> None:
    """Gradients along the mean rows of bands, which are `row_step` rows high, and how many have each size.

    Parameters
    ----------
    least : (H, W) uint8
        See `least_channel`; W is at least 3.
    row_step : int
        Means are rounded to grey levels, halves to even.
    gradient : (H // row_step, W) int16
        Result, eighths of a grey level: (-1, -2, 0, 2, 1) beside each pixel, mirrored about the border's pixels.
    sizes : (766,) int64
        Result: how many gradients are as large as the index, to either side.
    """
    bands, width = gradient.shape
    # in single precision, as `cv2.resize` takes the mean of an area
    weight = np.float32(1.0) / np.float32(row_step)
    total, mean = np.empty(width, np.int32), np.empty(width + 4, np.int16)
    sizes[:] = 0
    for band in range(bands):
        total[:] = 0
        for v in range(band * row_step, (band + 1) * row_step):
            for u in range(width):
                total[u] += least[v, u]
        for u in range(width):
            mean[u + 2] = np.int16(np.rint(np.float32(total[u]) * weight))
        mean[0], mean[1], mean[width + 2], mean[width + 3] = mean[4], mean[3], mean[width], mean[width - 1]
        for u in range(width):
            gradient[band, u] = mean[u + 4] - mean[u] + 2 * (mean[u + 3] - mean[u + 1])
        for u in range(width):
            sizes[abs(np.int64(gradient[band, u]))] += 1


@compiled
def median_size(sizes: Int64Array) -> float:
    """Median of whole numbers from 0 on, of which `sizes` tells how many there are of each; NaN if there are none."""
    count = sizes.sum()
    if count == 0:
        return np.nan
    lower, upper, before = variable(-1), variable(-1), variable(0)
    for size in range(sizes.shape[0]):
        before += sizes[size]
        if lower < 0 and before > (count - 1) // 2:
            lower = size
        if before > count // 2:
            upper = size
            break
    return 0.5 * (lower + upper)


@compiled
def _vertex(before: int, at: int, after: int) -> float:
    """Where sizes of a gradient about its greatest one have their greatest value, pixels from the middle."""
    low, mid, high = 0.125 * abs(before), 0.125 * abs(at), 0.125 * abs(after)
    bend = max(2.0 * mid - low - high, 1e-6)
    return min(max((high - low) / (2.0 * bend), -0.5), 0.5)


@compiled
def find_white_runs(
    gradient: Int16Array, row_step: int, noise: float, width_px: tuple[float, float], runs: WhiteRuns
) -> int:
    """Find runs between a steep rise and one of the next three steep falls: a speck on the paint must not end a run.

    Parameters
    ----------
    gradient : (R, W) int16
        See `band_gradients`.
    row_step : int
        Rows from one band to the next.
    noise : float
        Of a gradient, grey levels: edges are four times as steep, and steeper than the gradients beside them.
    width_px : (float, float)
        Least and greatest width of a run.
    runs : WhiteRuns
        Results, sorted by row, at sub-pixel columns; contrast is the weaker edge's gradient in units of the noise.

    Returns
    -------
    int
        How many there are.
    """
    bands, width = gradient.shape
    steep = 4.0 * noise * GRADIENTS_PER_LEVEL
    unit = np.float32(noise)
    count = variable(0)
    rises, falls = np.empty(width, np.int64), np.empty(width, np.int64)
    for band in range(bands):
        rising, falling = variable(0), variable(0)
        for u in range(1, width - 1):
            here = gradient[band, u]
            if here > steep:
                if here >= gradient[band, u - 1] and here > gradient[band, u + 1]:
                    rises[rising] = u
                    rising += 1
            elif here < -steep and here <= gradient[band, u - 1] and here < gradient[band, u + 1]:
                falls[falling] = u
                falling += 1
        for skip in range(RUNS_PER_RISE):
            first = variable(0)
            for n in range(rising):
                start = rises[n]
                while first < falling and falls[first] < start:
                    first += 1
                if first + skip >= falling:
                    break
                end = falls[first + skip]
                if not width_px[0] <= end - start <= width_px[1]:
                    continue
                up, down = gradient[band, start], -gradient[band, end]
                runs.row[count] = (band + 0.5) * row_step - 0.5
                runs.left[count] = start + _vertex(gradient[band, start - 1], up, gradient[band, start + 1])
                runs.right[count] = end + _vertex(gradient[band, end - 1], down, gradient[band, end + 1])
                runs.contrast[count] = np.float32(0.125 * min(up, down)) / unit
                count += 1
    return count
