"""Finds white lines without a pose: bright bands with carpet on both sides, along rows and columns.

If the camera's tilt is known, a band must be as wide on the floor as a line.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array, UInt8Array
from robocup_vision.compiling.loops import compiled, variable
from robocup_vision.kernels.algebra.lens import BENT
from robocup_vision.kernels.model_edges.carpet import is_carpet, is_carpet_at, other_light
from robocup_vision.kernels.model_edges.prediction import FRAME, on_floor, pose_frame

ONE, TWO = np.uintp(1), np.uintp(2)
FLANK = 3  # distance in pixels from a band at which the carpet shows without blur
# least and greatest width of a band on the floor, in widths of a line: a row or column crosses it at up to 60 degrees
MIN_WIDTHS, MAX_WIDTHS = 0.5, 2.0
BLUR_PX = 3.0  # what blur adds to a band


class LineLook(NamedTuple):
    """What counts as a line, and what is read.

    `min_step` is the least step of the sum of blue and red, grey levels; `width_m` the painted width; `max_widths` the
    greatest width in painted widths; `stride` the distance of the rows and columns that are read, pixels.
    """

    min_step: float
    width_m: float
    max_widths: float
    stride: int


@compiled(fastmath=True, error_model="numpy")
def _read(flat: UInt8Array, start: int, step: int, length: int, light: Int64Array) -> None:
    """Fill in the sum of blue and red along a row or column; green is left out because the carpet has it."""
    at = start
    for i in range(length):
        light[i] = int(flat[np.uintp(at)]) + int(flat[np.uintp(at + 2)])
        at += step


@compiled(fastmath=True, error_model="numpy")
def _is_line(
    flat: UInt8Array, start: int, step: int, beside: int, band: tuple[float, float], carpet: FloatArray
) -> bool:
    """Return whether carpet lies on both sides of a band (begin, end), and the band is not carpet in other light."""
    if not _begins_carpet(flat, start + int(band[0]) * step, -step, beside, carpet):
        return False
    if not _begins_carpet(flat, start + int(band[1]) * step, step, beside, carpet):
        return False
    if other_light(carpet) == carpet[0] + carpet[1] + carpet[2]:
        return True
    # where a carpet lies in sun and shade, a band of it may be as bright as a line
    middle = np.uintp(start + int(0.5 * (band[0] + band[1]) + 0.5) * step)
    return not is_carpet(float(flat[middle]), float(flat[middle + ONE]), float(flat[middle + TWO]), carpet)


@compiled(fastmath=True, error_model="numpy")
def _begins_carpet(flat: UInt8Array, at: int, outwards: int, beside: int, carpet: FloatArray) -> bool:
    """Return whether carpet shows one or both of `FLANK` - 1 and `FLANK` pixels beyond a band's end.

    Blur may reach the nearer pixel, and a board may stand on the farther one.
    """
    for away in range(FLANK - 1, FLANK + 1):
        if is_carpet_at(flat, at + away * outwards, outwards, beside, carpet):
            return True
    return False


@compiled(fastmath=True, error_model="numpy")
def _length_m(lens: FloatArray, frame: FloatArray, by_row: bool, at: int, begin: float, end: float) -> float:
    """Return the length on the floor, metres, of a piece of row or column `at`; -1 if it does not lie on the floor."""
    u, v = (begin, float(at)) if by_row else (float(at), begin)
    x, y, is_floor = on_floor(lens, frame, u, v)
    u, v = (end, float(at)) if by_row else (float(at), end)
    x2, y2, is_floor_too = on_floor(lens, frame, u, v)
    return math.sqrt((x - x2) ** 2 + (y - y2) ** 2) if is_floor and is_floor_too else -1.0


@compiled(fastmath=True, error_model="numpy")
def _below_horizon(lens: FloatArray, frame: FloatArray, by_row: bool, at: int, length: int) -> int:
    """Return the first pixel of a row or column that may show the floor, by a lens without distortion.

    If none does it is the length of the row or column.
    """
    if by_row:
        return 0 if on_floor(lens, frame, 0.0, at)[2] or on_floor(lens, frame, length - 1.0, at)[2] else length
    # rays to the horizon are level
    right = (at - lens[2]) / frame[12]
    return int(lens[3] + frame[13] * (frame[6] - right * frame[7]) / frame[8]) + 2


@compiled(fastmath=True, error_model="numpy")
def _widest_px(
    lens: FloatArray, frame: FloatArray, look: LineLook, by_row: bool, at: int, begin: int, length: int
) -> int:
    """Return the greatest width in pixels of a line that begins at a pixel; 0 if the pixel does not show the floor."""
    pixel_m = _length_m(lens, frame, by_row, at, begin - 0.5, begin + 0.5)
    # factor 2: nearer to the camera a pixel covers less of the floor than where the band begins
    return min(int(2.0 * look.max_widths * look.width_m / pixel_m + BLUR_PX), length) if pixel_m > 0.0 else 0


@compiled(fastmath=True, error_model="numpy")
def _is_as_wide(
    lens: FloatArray, frame: FloatArray, look: LineLook, by_row: bool, at: int, begin: float, end: float
) -> bool:
    """Return whether a band is as wide on the floor as a line, apart from blur."""
    wide_px, wide_m = end - begin, _length_m(lens, frame, by_row, at, begin, end)
    is_wide_enough = wide_m * (wide_px + 1.0) >= MIN_WIDTHS * look.width_m * wide_px
    return wide_m > 0.0 and is_wide_enough and wide_m * (wide_px - BLUR_PX) <= look.max_widths * look.width_m * wide_px


@compiled(fastmath=True, error_model="numpy")
def _half_height(light: Int64Array, rise: int, length: int, ground: float, widest_px: int) -> tuple[float, float]:
    """Return where a band that begins near pixel `rise` crosses half its height; the end is -1 if it does not end."""
    top, i = 0.0, variable(rise)
    while i < length - 1 and i - rise <= widest_px and light[i] > 0.5 * (ground + max(top, light[rise])):
        top = max(top, float(light[i]))
        i += 1
    half = 0.5 * (ground + top)
    if i >= length - 1 or light[i] > half:
        return 0.0, -1.0
    end = i - (half - light[i]) / max(light[i - 1] - light[i], 1.0)
    k = variable(rise - 1)
    while k < i and light[k] < half:
        k += 1
    begin = k - (light[k] - half) / max(light[k] - light[k - 1], 1.0)
    return begin, end


@compiled(fastmath=True, error_model="numpy")
def _scan(
    image: UInt8Array,
    carpet: FloatArray,
    look: LineLook,
    widest_px: int,
    lens: FloatArray,
    frame: FloatArray,
    found: FloatArray,
) -> int:
    """Find bands along some rows and columns; see `line_bands` for the results.

    If `frame` is not empty (see `pose_frame`), bands must lie on the floor and be as wide there as a line.
    """
    height, width = image.shape[0], image.shape[1]
    flat = image.reshape(-1)
    light = np.empty(max(height, width), np.int64)
    is_known = frame.shape[0] > 0
    count = variable(0)
    for axis in range(2):
        by_row = axis == 1
        lines, length = (height, width) if by_row else (width, height)
        step, beside = (3, 3 * width) if by_row else (3 * width, 3)
        for index in range(max(look.stride // 2, 1), lines - 1, look.stride):
            i = variable(FLANK)
            if is_known and lens[BENT] == 0.0:
                i = max(i, _below_horizon(lens, frame, by_row, index, length))
            start = 3 * index * width if by_row else 3 * index
            if i < length:
                _read(flat, start, step, length, light)
            while i < length - FLANK - 1 and count < found.shape[0]:
                ground = 0.5 * (light[i - 3] + light[i - 2])
                if light[i] - ground < look.min_step:
                    i += 1
                    continue
                limit_px = _widest_px(lens, frame, look, by_row, index, i, length) if is_known else widest_px
                begin, end = _half_height(light, i, length, ground, limit_px) if limit_px > 0 else (0.0, -1.0)
                if end < 0.0:
                    i += 1
                    continue
                is_inside = begin >= FLANK + 1 and end + FLANK + 2 < length
                if is_inside and (not is_known or _is_as_wide(lens, frame, look, by_row, index, begin, end)):
                    if _is_line(flat, start, step, beside, (begin, end), carpet):
                        along = 0.5 * (begin + end)
                        found[count, 0], found[count, 1] = (along, float(index)) if by_row else (float(index), along)
                        found[count, 2] = 1.0 if by_row else 0.0
                        if found.shape[1] > 3:
                            found[count, 3] = end - begin
                        count += 1
                i = int(end) + 2
    return count


@compiled(fastmath=True, error_model="numpy")
def line_bands(
    image: UInt8Array, carpet: FloatArray, min_step: float, widest_px: int, stride: int, bands: FloatArray
) -> int:
    """Find bright bands with carpet on both sides along some rows and columns; returns their number.

    Parameters
    ----------
    image : (H, W, 3) uint8
        BGR.
    carpet : (5,) or (8,) float64
        As `carpet_look` returns.
    min_step : float
        Least excess of the sum of blue and red over that of the carpet before the band (grey levels).
    widest_px : int
        Greatest width of a line.
    stride : int
        Distance of the rows and columns that are read.
    bands : (P, 4) float64
        Result: pixels u, v of the middle, 1 if a row was read and 0 if a column, and the width in pixels along it
        between the places of half the height.
    """
    nothing = np.empty(0)
    return _scan(image, carpet, LineLook(min_step, 0.0, 0.0, stride), widest_px, nothing, nothing, bands)


@compiled(fastmath=True, error_model="numpy")
def line_points(
    image: UInt8Array, lens: FloatArray, p: FloatArray, carpet: FloatArray, look: LineLook, points: FloatArray
) -> int:
    """Find the middles of lines along some rows and columns, without a pose; returns their number.

    Parameters
    ----------
    image : (H, W, 3) uint8
        BGR.
    lens : (L,) float64
        See `prediction.predict`.
    p : (7,) float64
        Unknowns, of which tilt, roll, height and focal length are used: they determine the width of a line.
    carpet : (5,) or (8,) float64
        As `carpet_look` returns.
    look : LineLook
        What counts as a line.
    points : (P, 3) float64
        Result: pixels u, v, and 1 if a row was read, 0 if a column.
    """
    frame = np.empty(FRAME)
    pose_frame(p, lens, frame)
    return _scan(image, carpet, look, 0, lens, frame, points)
