"""Finds white lines without a pose: bright bands between carpets, along rows and columns.

Where the camera's tilt is known a band must be as wide on the floor as a line; where it is not, widths bound the tilt.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array, UInt8Array
from robocup_vision.compiling.loops import compiled, variable
from robocup_vision.kernels.algebra.lens import BENT
from robocup_vision.kernels.model_edges.carpet import is_carpet, is_carpet_at, other_light
from robocup_vision.kernels.model_edges.prediction import on_floor, pose_frame

ONE, TWO = np.uintp(1), np.uintp(2)
FLANK = 3  # pixels beside a band that blur leaves to the carpet
# least and greatest width of a band on the floor, in widths of a line: a row or column crosses it at up to 60 degrees
MIN_WIDTHS, MAX_WIDTHS = 0.5, 2.0
BLUR_PX = 3.0  # what blur adds to a band


class LineLook(NamedTuple):
    """What counts as a line: its step in blue and red together (grey levels), widths, and rows between read ones."""

    min_step: float
    width_m: float
    max_widths: float
    stride: int


@compiled(fastmath=True, error_model="numpy")
def _read(flat: UInt8Array, start: int, step: int, length: int, light: Int64Array) -> None:
    """Add up blue and red along a row or column: the carpet's green is left out."""
    at = start
    for i in range(length):
        light[i] = int(flat[np.uintp(at)]) + int(flat[np.uintp(at + 2)])
        at += step


@compiled(fastmath=True, error_model="numpy")
def _is_line(
    flat: UInt8Array, start: int, step: int, beside: int, band: tuple[float, float], carpet: FloatArray
) -> bool:
    """Whether carpet lies on both sides of a band from its begin to its end, and the band is none in other light."""
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
    """Whether carpet begins within `FLANK` pixels beyond a band's end: blur takes some of them, boards bound others."""
    for away in range(FLANK - 1, FLANK + 1):
        if is_carpet_at(flat, at + away * outwards, outwards, beside, carpet):
            return True
    return False


@compiled(fastmath=True, error_model="numpy")
def _length_m(lens: FloatArray, frame: FloatArray, by_row: bool, at: int, begin: float, end: float) -> float:
    """How long a piece of a row or column is on the floor; -1 where it does not lie there."""
    u, v = (begin, float(at)) if by_row else (float(at), begin)
    x, y, is_floor = on_floor(lens, frame, u, v)
    u, v = (end, float(at)) if by_row else (float(at), end)
    x2, y2, is_floor_too = on_floor(lens, frame, u, v)
    return math.sqrt((x - x2) ** 2 + (y - y2) ** 2) if is_floor and is_floor_too else -1.0


@compiled(fastmath=True, error_model="numpy")
def _below_horizon(lens: FloatArray, frame: FloatArray, by_row: bool, at: int, length: int) -> int:
    """Where a row or column may begin to show the floor, by a lens that bends no line; its length where nowhere."""
    if by_row:
        return 0 if on_floor(lens, frame, 0.0, at)[2] or on_floor(lens, frame, length - 1.0, at)[2] else length
    # rays to the horizon are level
    right = (at - lens[2]) / frame[12]
    return int(lens[3] + frame[13] * (frame[6] - right * frame[7]) / frame[8]) + 2


@compiled(fastmath=True, error_model="numpy")
def _widest_px(
    lens: FloatArray, frame: FloatArray, look: LineLook, by_row: bool, at: int, begin: int, length: int
) -> int:
    """How wide a line that begins at a place may be in the picture; 0 where no floor is."""
    pixel_m = _length_m(lens, frame, by_row, at, begin - 0.5, begin + 0.5)
    # nearer to the camera a pixel is less of the floor than where the band begins
    return min(int(2.0 * look.max_widths * look.width_m / pixel_m + BLUR_PX), length) if pixel_m > 0.0 else 0


@compiled(fastmath=True, error_model="numpy")
def _is_as_wide(
    lens: FloatArray, frame: FloatArray, look: LineLook, by_row: bool, at: int, begin: float, end: float
) -> bool:
    """Whether a band is as wide on the floor as a line, but for blur."""
    wide_px, wide_m = end - begin, _length_m(lens, frame, by_row, at, begin, end)
    is_wide_enough = wide_m * (wide_px + 1.0) >= MIN_WIDTHS * look.width_m * wide_px
    return wide_m > 0.0 and is_wide_enough and wide_m * (wide_px - BLUR_PX) <= look.max_widths * look.width_m * wide_px


@compiled(fastmath=True, error_model="numpy")
def _half_height(light: Int64Array, rise: int, length: int, ground: float, widest_px: int) -> tuple[float, float]:
    """Places between which a band that rises at `rise` is brighter than half its height; the second -1 if none ends."""
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

    Where the camera's `frame` is known, of `pose_frame`, not empty, bands lie on the floor and are as wide as a line.
    """
    height, width = image.shape[0], image.shape[1]
    flat = image.reshape(-1)
    light = np.empty(max(height, width), np.int64)
    is_known = frame.shape[0] > 0
    count = variable(0)
    for turn in range(2):
        by_row = turn == 1
        lines, length = (height, width) if by_row else (width, height)
        step, beside = (3, 3 * width) if by_row else (3 * width, 3)
        for at in range(max(look.stride // 2, 1), lines - 1, look.stride):
            i = variable(FLANK)
            if is_known and lens[BENT] == 0.0:
                i = max(i, _below_horizon(lens, frame, by_row, at, length))
            start = 3 * at * width if by_row else 3 * at
            if i < length:
                _read(flat, start, step, length, light)
            while i < length - FLANK - 1 and count < found.shape[0]:
                ground = 0.5 * (light[i - 3] + light[i - 2])
                if light[i] - ground < look.min_step:
                    i += 1
                    continue
                limit_px = _widest_px(lens, frame, look, by_row, at, i, length) if is_known else widest_px
                begin, end = _half_height(light, i, length, ground, limit_px) if limit_px > 0 else (0.0, -1.0)
                if end < 0.0:
                    i += 1
                    continue
                is_inside = begin >= FLANK + 1 and end + FLANK + 2 < length
                if is_inside and (not is_known or _is_as_wide(lens, frame, look, by_row, at, begin, end)):
                    if _is_line(flat, start, step, beside, (begin, end), carpet):
                        along = 0.5 * (begin + end)
                        found[count, 0], found[count, 1] = (along, float(at)) if by_row else (float(at), along)
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
    """Find bright bands that have carpet on both sides, and are none themselves, along some rows and columns.

    Parameters
    ----------
    image : (H, W, 3) uint8
        BGR.
    carpet : (5,) or (8,) float64
        As `carpet_look` returns.
    min_step : float
        By which blue and red together must exceed those of the carpet before the band (grey levels).
    widest_px : int
        What is wider is no line.
    stride : int
        Rows and columns between those that are read.
    bands : (P, 4) float64
        Result: pixels u, v of the middle, 1 where a row was read and 0 a column, and the width along it between the
        places of half the height.

    Returns
    -------
    int
        How many.
    """
    nothing = np.empty(0)
    return _scan(image, carpet, LineLook(min_step, 0.0, 0.0, stride), widest_px, nothing, nothing, bands)


@compiled(fastmath=True, error_model="numpy")
def line_points(
    image: UInt8Array, lens: FloatArray, p: FloatArray, carpet: FloatArray, look: LineLook, points: FloatArray
) -> int:
    """Find the middles of lines whatever the pose, along some rows and columns.

    Parameters
    ----------
    image : (H, W, 3) uint8
        BGR.
    lens : (L,) float64
        See `prediction.predict`.
    p : (7,) float64
        Tilt, roll, height and focal length count: they determine the width of a line.
    carpet : (5,) or (8,) float64
        As `carpet_look` returns.
    look : LineLook
        What counts as a line.
    points : (P, 3) float64
        Result: pixels u, v, and 1 where a row was read, 0 a column.

    Returns
    -------
    int
        How many.
    """
    frame = np.empty(16)
    pose_frame(p, lens, frame)
    return _scan(image, carpet, look, 0, lens, frame, points)
