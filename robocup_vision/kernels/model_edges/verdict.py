"""Decides whether a picture confirms a pose: samples found, hidden or missing, and line points left unexplained."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.compiling.loops import compiled, variable
from robocup_vision.kernels.algebra.lens import slopes_at
from robocup_vision.kernels.model_edges.carpet import is_carpet, other_light
from robocup_vision.kernels.model_edges.prediction import pose_frame
from robocup_vision.kernels.model_edges.tables import (
    EDGE,
    FOUND,
    HIDDEN,
    MISSING,
    ON_FLOOR,
    RIDGE,
    UNKNOWNS,
    UNSEEN,
    FloatArray,
    FollowSettings,
    Int64Array,
    Room,
    UInt8Array,
)

# a line so wide is not overlooked
SURE_PX = 1.0


class LineLook(NamedTuple):
    """What counts as a line: its step in blue and red together (grey levels), its width, and rows between read ones."""

    min_step: float
    width_m: float
    stride: int


@compiled(fastmath=True, error_model="numpy")
def _patch(image: UInt8Array, u: float, v: float, carpet: FloatArray) -> bool:
    """Return whether plain carpet lies at a pixel: the mean of three by three pixels is the carpet's colour."""
    x, y = int(round(u)), int(round(v))
    if x < 1 or y < 1 or x > image.shape[1] - 2 or y > image.shape[0] - 2:
        return False
    b, g, r = 0.0, 0.0, 0.0
    for i in range(-1, 2):
        for j in range(-1, 2):
            b += image[y + i, x + j, 0]
            g += image[y + i, x + j, 1]
            r += image[y + i, x + j, 2]
    # a mean of nine: with a pixel's noise a dark robot would be as green as carpet
    return is_carpet(b / 9.0, g / 9.0, r / 9.0, carpet, 1.0 / 3.0)


@compiled(fastmath=True, error_model="numpy")
def judge(
    image: UInt8Array, carpet: FloatArray, settings: FollowSettings, room: Room, count: int, z: FloatArray
) -> tuple[int, int, int, int]:
    """Classify each sample.

    A sample without a candidate speaks against a pose only where plain carpet shows in place of the paint; anything
    else there may stand before it. A line thinner than a pixel is easily overlooked: it speaks against nothing.

    Returns
    -------
    int, int, int, int
        How many were found, are missing, are found on something upright, are hidden there; `found.status` takes each
        one's.
    """
    samples, rows, found, gate_px = room.samples, room.rows, room.found, settings.gate_px
    seen, missing, upright, hidden = 0, 0, 0, 0
    for n in range(count):
        if found.candidates[n] < 0:
            found.status[n] = UNSEEN
            continue
        expected = 0.0
        for j in range(UNKNOWNS):
            expected += rows[n, j] * z[j]
        hit = False
        for k in range(found.candidates[n]):
            if abs(found.offset_px[n, k] - expected) < gate_px:
                hit = True
        if hit:
            found.status[n] = FOUND
            seen += 1
            if samples.place[n] != ON_FLOOR:
                upright += 1
            continue
        if samples.kind[n] == RIDGE and samples.width_px[n] < SURE_PX:
            found.status[n] = HIDDEN
            continue
        # into what should be painted
        into = expected
        if samples.kind[n] == EDGE:
            into += 0.5 * min(samples.width_px[n], 8.0)
        u = samples.uv[n, 0] + samples.normal[n, 0] * into
        v = samples.uv[n, 1] + samples.normal[n, 1] * into
        if _patch(image, u, v, carpet):
            found.status[n] = MISSING
            missing += 1
        else:
            found.status[n] = HIDDEN
            if samples.place[n] != ON_FLOOR:
                hidden += 1
    return seen, missing, upright, hidden


@compiled(fastmath=True, error_model="numpy")
def line_points(
    image: UInt8Array, lens: FloatArray, p: FloatArray, carpet: FloatArray, look: LineLook, points: FloatArray
) -> int:
    """Find points on lines whatever the pose: pixels brighter than carpet on both sides, along some rows and columns.

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
    height, width = image.shape[0], image.shape[1]
    least, stride, line_width_m = look.min_step, look.stride, look.width_m
    fu, fv = lens[0] * math.exp(p[6]), lens[1] * math.exp(p[6])
    count = variable(0)
    flat = image.reshape(-1)
    longest = max(height, width)
    sums, bright_at = np.empty(longest + 1, np.int64), np.empty(longest, np.int64)
    inner_of_row = np.empty(height, np.int64)
    tan_tilt, tan_roll = math.tan(p[3]), math.tan(p[4])
    scale = math.exp(-p[6])
    for i in range(height):
        # how many pixels down a unit of slope is, at this row of the middle column
        upper, lower = slopes_at(lens, lens[2], i - 0.5)[1] * scale, slopes_at(lens, lens[2], i + 0.5)[1] * scale
        down = max(0.5 * (upper + lower) - tan_tilt, 0.0)
        inner_of_row[i] = min(max(int(round(line_width_m * down * down / p[5] / (lower - upper))), 1), 41)
    # most pixels are too dark to be part of a line
    bright = int(math.floor(carpet[0] + carpet[2] + 0.5 * least))
    for turn in range(2):
        by_row = turn == 1
        lines, length = (height, width) if by_row else (width, height)
        for at in range(stride // 2, lines, stride):
            # the horizon where this row or column meets it
            inner, shift, begin = 0, 0, 0
            if by_row:
                slope = slopes_at(lens, lens[2], at)[1] * scale
                down = slope - tan_tilt
                if down < 0.02:
                    continue
                # a lens scales across the radius as along it goes from the axis to this row
                per_slope_px = (at - lens[3]) / slope * fu / fv if abs(slope) > 0.01 else fu
                inner = min(max(int(round(per_slope_px * line_width_m * down / p[5])), 1), 41)
            else:
                shift = int(round(tan_roll * (at - lens[2])))
                begin = max(int(lens[3] + fv * tan_tilt - tan_roll * (at - lens[2])) + 2, 0)
            if begin > length - 8:
                continue
            start = 3 * (at * width + begin) if by_row else 3 * (begin * width + at)
            number = _read(flat, start, 3 if by_row else 3 * width, begin, length, bright, sums, bright_at)
            peak, place, half, last = 0.0, variable(-1), variable(1), variable(-1)
            for k in range(number):
                i = bright_at[k]
                # a darker pixel between two bright ones ends what is near enough
                if place >= 0 and i - 1 > max(last, place + half):
                    count = _keep(image, at, place, half, by_row, carpet, points, count)
                    peak, place = 0.0, -1
                last = i
                wide = inner if by_row else inner_of_row[min(max(i + shift, 0), height - 1)]
                reach = wide // 2
                gap = reach + (2 if wide > 1 else 1)
                if i - gap - 2 < begin or i + gap + 3 > length:
                    continue
                inside = (sums[i + reach + 1] - sums[i - reach]) / (2 * reach + 1)
                rise = inside - (sums[i - gap + 1] - sums[i - gap - 1]) * 0.5
                if rise > least:
                    rise = min(rise, inside - (sums[i + gap + 2] - sums[i + gap]) * 0.5)
                if rise > least and rise > peak:
                    peak, place, half = rise, i, gap
                elif place >= 0 and i > place + half:
                    count = _keep(image, at, place, half, by_row, carpet, points, count)
                    peak, place = 0.0, -1
            if place >= 0:
                count = _keep(image, at, place, half, by_row, carpet, points, count)
    return count


@compiled(fastmath=True, error_model="numpy", inline="always")
def _read(
    flat: UInt8Array,
    start: int,
    step: int,
    begin: int,
    length: int,
    bright: int,
    sums: Int64Array,
    bright_at: Int64Array,
) -> int:
    """Sum up blue and red along a row or column, from place `begin` on; list the bright places but near its ends.

    Returns how many these are; without any the sums are not made.
    """
    number = variable(0)
    at = start
    for i in range(begin, length):
        light = int(flat[np.uintp(at)]) + int(flat[np.uintp(at + 2)])
        sums[i + 1] = light
        if light > bright and i >= begin + 6 and i < length - 6:
            bright_at[number] = i
            number += 1
        at += step
    if number > 0:
        sums[begin] = 0
        for i in range(begin, length):
            sums[i + 1] += sums[i]
    return number


@compiled(fastmath=True, error_model="numpy")
def _keep(
    image: UInt8Array, at: int, place: int, half: int, by_row: bool, carpet: FloatArray, points: FloatArray, count: int
) -> int:
    """Keep a ridge that has carpet on both sides, and is none itself."""
    if count >= points.shape[0]:
        return count
    for side in range(2):
        i = place + (half + 1) * (2 * side - 1)
        if by_row:
            if i < 0 or i >= image.shape[1]:
                return count
            b, g, r = float(image[at, i, 0]), float(image[at, i, 1]), float(image[at, i, 2])
        else:
            if i < 0 or i >= image.shape[0]:
                return count
            b, g, r = float(image[i, at, 0]), float(image[i, at, 1]), float(image[i, at, 2])
        if not is_carpet(b, g, r, carpet):
            return count
    x, y = (place, at) if by_row else (at, place)
    # where a carpet lies in sun and shade, a band of it may be as bright as a line
    b, g, r = float(image[y, x, 0]), float(image[y, x, 1]), float(image[y, x, 2])
    if other_light(carpet) != carpet[0] + carpet[1] + carpet[2] and is_carpet(b, g, r, carpet):
        return count
    points[count, 0], points[count, 1] = float(x), float(y)
    points[count, 2] = 1.0 if by_row else 0.0
    return count + 1


@compiled(fastmath=True, error_model="numpy")
def explained(
    room: Room,
    number: int,
    count: int,
    z: FloatArray,
    spacing_px: float,
    gate_px: float,
    silent: FloatArray,
    lens: FloatArray,
    p: FloatArray,
) -> tuple[int, int]:
    """Count the line points that lie on predicted lines, and the others that are silent.

    Parameters
    ----------
    room : Room
        With samples and line points.
    number, count : int
        How many points and samples it holds.
    z : (7,) float64
        The fit, about where the samples were predicted.
    spacing_px, gate_px : float
        See `FollowSettings`.
    silent : (B, 6) float64
        See `FieldEdges`.
    lens : (L,) float64
        See `prediction.predict`.
    p : (7,) float64
        The unknowns of the fit.

    Returns
    -------
    int, int
        How many are explained, and how many more speak neither for nor against the pose.
    """
    points, samples, rows = room.points, room.samples, room.rows
    right, neutral = 0, 0
    frame = np.empty(16)
    pose_frame(p, lens, frame)
    for m in range(number):
        u, v = points[m, 0], points[m, 1]
        known = False
        for n in range(count):
            if samples.place[n] != ON_FLOOR:
                continue
            du, dv = u - samples.uv[n, 0], v - samples.uv[n, 1]
            if abs(du) > 2.0 * spacing_px or abs(dv) > 2.0 * spacing_px:
                continue
            nu, nv = samples.normal[n, 0], samples.normal[n, 1]
            across = du * nu + dv * nv
            for j in range(UNKNOWNS):
                across -= rows[n, j] * z[j]
            along = dv * nu - du * nv
            slack = gate_px
            if samples.kind[n] != RIDGE:
                slack += 0.5 * samples.width_px[n]
                across -= 0.5 * samples.width_px[n]
            if abs(along) < 1.2 * spacing_px and abs(across) < slack:
                known = True
                break
        if known:
            right += 1
        elif _is_silent(silent, lens, frame, u, v):
            neutral += 1
    return right, neutral


@compiled(fastmath=True, error_model="numpy")
def _is_silent(silent: FloatArray, lens: FloatArray, frame: FloatArray, u: float, v: float) -> bool:
    """Return whether the ray of a pixel passes through a silent box; `frame` as `pose_frame` prepares it."""
    right, down = slopes_at(lens, u, v)
    right, down = right * lens[0] / frame[12], down * lens[1] / frame[13]
    for n in range(silent.shape[0]):
        # of the way along the ray, its length ahead being 1
        begin, end = 0.0, 1e9
        for k in range(3):
            step = frame[3 * k] - right * frame[3 * k + 1] - down * frame[3 * k + 2]
            times = 1.0 / step if abs(step) > 1e-9 else 1e9
            low, high = (silent[n, 2 * k] - frame[9 + k]) * times, (silent[n, 2 * k + 1] - frame[9 + k]) * times
            begin, end = max(begin, min(low, high)), min(end, max(low, high))
        if begin <= end:
            return True
    return False
