"""Searches predicted edges along the pixel row or column nearest to their normal, so that no pixel is interpolated.

Three neighbouring rows or columns, shifted with the edge's slope, are averaged to reduce noise.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.compiling.loops import compiled, variable
from robocup_vision.kernels.model_edges.carpet import is_carpet, is_paint
from robocup_vision.kernels.model_edges.tables import (
    EDGE,
    ON_FLOOR,
    PEAKS,
    RIDGE,
    UNKNOWNS,
    Buffers,
    Findings,
    FloatArray,
    FollowSettings,
    Samples,
    UInt8Array,
)

FLANK_PX = 2
# two standard deviations of the blur by lens and pixels: a window that reaches so near a band's other end shifts the
# edge
END_BLUR_PX = 1.5
# least step of a band, as a fraction of a line's full step; width that blur may add to it; and the widest band read
MIN_BAND_RATIO, BAND_BLUR_PX, MAX_BAND_PX = 0.25, 4.0, 120.0
# greatest reach of a search, and greatest length of its profile
MAX_REACH_PX, MAX_PROFILE_PX = 110, 480
ONE, TWO = np.uintp(1), np.uintp(2)


@compiled(fastmath=True, error_model="numpy")
def _mean_of_three(flat: UInt8Array, at: int, beside: int) -> tuple[float, float, float]:
    """Blue, green and red of three neighbouring pixels of a flattened picture."""
    first, middle, last = np.uintp(at - beside), np.uintp(at), np.uintp(at + beside)
    blue = int(flat[first]) + int(flat[middle]) + int(flat[last])
    green = int(flat[first + ONE]) + int(flat[middle + ONE]) + int(flat[last + ONE])
    red = int(flat[first + TWO]) + int(flat[middle + TWO]) + int(flat[last + TWO])
    return blue / 3.0, green / 3.0, red / 3.0


class Profile(NamedTuple):
    """Pixels along a normal in a flattened picture: the first one's index, the steps to the next and to those beside.

    `inner` pixels inside are compared with as many outside, or for a ridge with the flanks beyond `gap` pixels.
    """

    origin: int
    advance: int
    beside: int
    inner: int
    gap: int


@compiled(fastmath=True, error_model="numpy", inline="always")
def _has_expected_sides(
    flat: UInt8Array,
    profile: Profile,
    first: int,
    kind: int,
    place: int,
    channel: FloatArray,
    carpet: FloatArray,
    brightness: float,
) -> bool:
    """Return whether the inside of an edge shows its paint, and carpet lies beside a line.

    Where something else lies beside it, the edge is not a line's but the end of the carpet or the outline of a robot.
    """
    origin, advance, beside, inner, gap = profile
    if kind == EDGE:
        inside = _mean_of_three(flat, origin + advance * (first + inner - 1), beside)
        if not is_paint(inside[0], inside[1], inside[2], channel, brightness):
            return False
    if place != ON_FLOOR:
        return True
    # cameras blur colours over more pixels than brightness: the neighbour's colour shows at the far end of a window
    outer = first - gap - FLANK_PX if kind == RIDGE else first - inner - 1
    before = _mean_of_three(flat, origin + advance * outer, beside)
    if not is_carpet(before[0], before[1], before[2], carpet):
        return False
    if kind == EDGE:
        return True
    after = _mean_of_three(flat, origin + advance * (first + inner + gap + FLANK_PX - 1), beside)
    return bool(is_carpet(after[0], after[1], after[2], carpet))


@compiled(fastmath=True, error_model="numpy", inline="always")
def _add_up(flat: UInt8Array, profile: Profile, channel: FloatArray, sums: FloatArray) -> None:
    """Fill in the cumulative sums (L + 1,), from 0, of a channel along a profile, averaged over three neighbours."""
    wb, wg, wr = channel[0] / 3.0, channel[1] / 3.0, channel[2] / 3.0
    at, beside = profile.origin, profile.beside
    sums[0] = 0.0
    if wg == 0.0:
        # white lines are read without their green, which the carpet has as well
        for i in range(sums.shape[0] - 1):
            a, b, c = np.uintp(at - beside), np.uintp(at), np.uintp(at + beside)
            blue = int(flat[a]) + int(flat[b]) + int(flat[c])
            red = int(flat[a + TWO]) + int(flat[b + TWO]) + int(flat[c + TWO])
            sums[i + 1] = sums[i] + (wb * blue + wr * red)
            at += profile.advance
        return
    for i in range(sums.shape[0] - 1):
        a, b, c = np.uintp(at - beside), np.uintp(at), np.uintp(at + beside)
        blue = int(flat[a]) + int(flat[b]) + int(flat[c])
        red = int(flat[a + TWO]) + int(flat[b + TWO]) + int(flat[c + TWO])
        green = int(flat[a + ONE]) + int(flat[b + ONE]) + int(flat[c + ONE])
        sums[i + 1] = sums[i] + (wb * blue + wg * green + wr * red)
        at += profile.advance


@compiled(fastmath=True, error_model="numpy", inline="always")
def _respond(sums: FloatArray, profile: Profile, flank: int, length: int, response: FloatArray) -> tuple[int, int]:
    """Fill in the response at each place: the mean of the `inner` pixels from there less that of those before.

    For a ridge, which has flanks, the brighter flank is subtracted. Returns the first and the last place written.
    """
    inner, gap = profile.inner, profile.gap
    if flank == 0:
        for i in range(inner, length - inner + 1):
            response[i] = (sums[i + inner] - 2.0 * sums[i] + sums[i - inner]) / inner
        return inner, length - inner
    begin, end = flank + gap, length - inner - flank - gap
    for i in range(begin, end + 1):
        inside = (sums[i + inner] - sums[i]) / inner
        before = (sums[i - gap] - sums[i - gap - flank]) / flank
        after = (sums[i + inner + gap + flank] - sums[i + inner + gap]) / flank
        response[i] = inside - max(before, after)
    return begin, end


@compiled(fastmath=True, error_model="numpy", inline="always")
def _keep_strongest(found: Findings, n: int, kept: int, strength: float, offset_px: float) -> int:
    """Insert a candidate of sample n among the `kept` strongest ones, in order; returns their new number."""
    place = kept
    while place > 0 and found.strength[n, place - 1] < strength:
        place -= 1
    if place >= PEAKS:
        return kept
    kept = min(kept + 1, PEAKS)
    for k in range(kept - 1, place, -1):
        found.strength[n, k] = found.strength[n, k - 1]
        found.offset_px[n, k] = found.offset_px[n, k - 1]
    found.strength[n, place] = strength
    found.offset_px[n, place] = offset_px
    return kept


@compiled(fastmath=True, error_model="numpy")
def search(
    image: UInt8Array,
    channels: FloatArray,
    carpet: FloatArray,
    brightness: float,
    settings: FollowSettings,
    buffers: Buffers,
    count: int,
) -> None:
    """Search each sample's edge within its reach, and fill in `found`'s offsets, strengths and candidates.

    Parameters
    ----------
    image : (H, W, 3) uint8
        BGR.
    channels : (K, 8) float64
        See `FieldEdges`.
    carpet : (5,) or (8,) float64
        See `carpet_look`.
    brightness : float
        Light of this picture, relative to that of `channels`.
    settings : FollowSettings
        `min_ratio` and `max_line_widths` are used.
    buffers : Buffers
        The first `count` samples and their reach; `found`.
    """
    samples, reach_px, found, min_ratio = buffers.samples, buffers.reach_px, buffers.found, settings.min_ratio
    height, width = image.shape[0], image.shape[1]
    flat = image.reshape(-1)
    sums, response = np.empty(MAX_PROFILE_PX + 1), np.empty(MAX_PROFILE_PX)
    for n in range(count):
        nu, nv = samples.normal[n, 0], samples.normal[n, 1]
        u, v = samples.uv[n, 0], samples.uv[n, 1]
        channel = samples.channel[n]
        # the response is of the mean of three neighbours
        wb, wg, wr = channels[channel, 0] / 3.0, channels[channel, 1] / 3.0, channels[channel, 2] / 3.0
        along_v = abs(nv) >= abs(nu)
        n_axis = nv if along_v else nu
        n_other = nu if along_v else nv
        step = 1 if n_axis > 0 else -1
        size_axis = height if along_v else width
        size_other = width if along_v else height
        middle = int(round(u if along_v else v))
        # where the edge crosses the middle row or column
        crossing = (v if along_v else u) - (middle - (u if along_v else v)) * n_other / n_axis
        start = int(round(crossing))
        slope = -n_other / n_axis
        shift = int(round(slope))
        if shift > 1:
            shift = 1
        elif shift < -1:
            shift = -1
        axis_component = abs(n_axis)
        band_px = samples.width_px[n] / axis_component
        if samples.kind[n] == RIDGE:
            inner = min(max(int(round(band_px)), 1), 6)
            filled_ratio = min(1.0, 0.75 * band_px / inner)
            flank = FLANK_PX
            gap = 1
            margin = inner // 2 + gap + flank + 2
            noise_ratio = 1.0 / inner + 1.0 / flank
        else:
            inner = min(max(int(band_px - END_BLUR_PX), 1), 3)
            filled_ratio = min(1.0, 0.8 * band_px / inner)
            flank, gap = inner, 0
            margin = inner + 2
            noise_ratio = 2.0 / inner
        norm = math.sqrt(wb * wb + wg * wg + wr * wr)
        noise = carpet[3] * norm * math.sqrt(3.0 * noise_ratio)
        expected = samples.expected[n] * brightness * filled_ratio
        found.candidates[n] = -1
        if expected < 4.0 * noise:
            continue
        min_strength = max(min_ratio * expected, 3.5 * noise)
        reach = min(int(math.ceil(reach_px[n] / axis_component)), MAX_REACH_PX)
        # a line on the floor may be wider than in the field file: the profile must contain the whole band
        may_be_wider = samples.place[n] == ON_FLOOR
        widest = min(settings.max_line_widths * band_px + BAND_BLUR_PX, MAX_BAND_PX)
        low, high = -reach - margin, reach + margin
        if may_be_wider:
            low, high = min(low, -reach - int(widest)), max(high, reach + int(widest))
        # keep within the picture, with the neighbours' shift
        if middle < 1 or middle > size_other - 2:
            continue
        first, last = start + step * low, start + step * high
        if step > 0:
            if first < 1:
                low += 1 - first
            if last > size_axis - 2:
                high -= last - (size_axis - 2)
        else:
            if first > size_axis - 2:
                low += first - (size_axis - 2)
            if last < 1:
                high -= 1 - last
        length = high - low + 1
        if length < 2 * margin:
            continue
        along = 3 * width if along_v else 3
        across = 3 if along_v else 3 * width
        origin = (start + step * low) * along + middle * across
        profile = Profile(origin, step * along, across + shift * along, inner, gap)
        _add_up(flat, profile, channels[channel], sums[: length + 1])
        is_ridge = samples.kind[n] == RIDGE
        begin, end = _respond(sums, profile, flank if is_ridge else 0, length, response)
        shift_of_place = 0.5 * (inner - 1) if is_ridge else -0.5
        kept = variable(0)
        for i in range(begin + 1, end):
            peak = response[i]
            if peak < min_strength or peak <= response[i - 1] or peak < response[i + 1]:
                continue
            curvature = response[i - 1] - 2.0 * peak + response[i + 1]
            fraction = 0.5 * (response[i - 1] - response[i + 1]) / curvature if curvature < 0.0 else 0.0
            offset = (start + step * (low + i + fraction + shift_of_place) - crossing) * n_axis
            if abs(offset) > reach_px[n] + 1.0:
                continue
            colors = channels[channel]
            if not _has_expected_sides(flat, profile, i, samples.kind[n], samples.place[n], colors, carpet, brightness):
                continue
            kept = _keep_strongest(found, n, kept, peak, offset)
        if kept == 0 and may_be_wider:
            full_step = samples.expected[n] * brightness
            level = max(MIN_BAND_RATIO * full_step, 3.5 * carpet[3] * norm * math.sqrt(3.0))
            at = variable(0)
            while at < length and kept < PEAKS:
                middle_px, strength, at = _next_band(
                    flat, profile, sums, length, level, widest, channels[channel], carpet, at
                )
                if at >= length:
                    break
                if not is_ridge:
                    middle_px -= 0.5 * band_px
                offset = (start + step * (low + middle_px) - crossing) * n_axis
                if abs(offset) <= reach_px[n] + 1.0:
                    kept = _keep_strongest(found, n, kept, strength, offset)
        found.candidates[n] = kept


@compiled(fastmath=True, error_model="numpy")
def _next_band(
    flat: UInt8Array,
    profile: Profile,
    sums: FloatArray,
    length: int,
    level: float,
    widest: float,
    channel: FloatArray,
    carpet: FloatArray,
    at: int,
) -> tuple[float, float, int]:
    """Find the next bright band of up to `widest` pixels with carpet on both sides on a profile, from pixel `at` on.

    Returns its middle between the places of half its height, its height above the carpet, and the pixel from which to
    search on, which is `length` if no band was found.
    """
    ground = channel[0] * carpet[0] + channel[1] * carpet[1] + channel[2] * carpet[2]
    while at < length:
        if sums[at + 1] - sums[at] < ground + level:
            at += 1
            continue
        first = at
        top = 0.0
        while at < length and sums[at + 1] - sums[at] >= ground + level:
            top = max(top, sums[at + 1] - sums[at])
            at += 1
        half = 0.5 * (ground + top)
        # where it is brighter than half its height
        left, right = first, at - 1
        while sums[left + 1] - sums[left] < half:
            left += 1
        while left > 0 and sums[left] - sums[left - 1] >= half:
            left -= 1
        while sums[right + 1] - sums[right] < half:
            right -= 1
        while right < length - 1 and sums[right + 2] - sums[right + 1] >= half:
            right += 1
        at = max(at, right + 1)
        if left < 2 or right > length - 3 or right - left + 1 > widest:
            continue
        before, after = sums[left] - sums[left - 1], sums[right + 2] - sums[right + 1]
        begin = left - (sums[left + 1] - sums[left] - half) / max(sums[left + 1] - sums[left] - before, 1.0)
        end = right + (sums[right + 1] - sums[right] - half) / max(sums[right + 1] - sums[right] - after, 1.0)
        # the carpet is read beyond the slopes at the band's sides
        away = 2 + (right - left) // 2
        if left - away < 0 or right + away >= length:
            continue
        outside = _mean_of_three(flat, profile.origin + profile.advance * (left - away), profile.beside)
        beyond = _mean_of_three(flat, profile.origin + profile.advance * (right + away), profile.beside)
        if not is_carpet(outside[0], outside[1], outside[2], carpet):
            continue
        if not is_carpet(beyond[0], beyond[1], beyond[2], carpet):
            continue
        return 0.5 * (begin + end), top - ground, at
    return 0.0, 0.0, length


@compiled(fastmath=True, error_model="numpy")
def whiten(samples: Samples, count: int, root: FloatArray, rows: FloatArray) -> None:
    """Fill in the derivatives (M, 7) by the prior's standard normal unknowns: the Jacobian times the root (7, 7)."""
    for n in range(count):
        for j in range(UNKNOWNS):
            value = 0.0
            for i in range(j, UNKNOWNS):
                value += samples.jacobian[n, i] * root[i, j]
            rows[n, j] = value


@compiled(fastmath=True, error_model="numpy")
def reaches(rows: FloatArray, count: int, settings: FollowSettings, reach_px: FloatArray) -> None:
    """Fill in the search range (M,) of samples: `reach_sigmas` standard deviations of their offsets by the prior."""
    for n in range(count):
        total = 0.0
        for j in range(UNKNOWNS):
            total += rows[n, j] * rows[n, j]
        reach_px[n] = settings.reach_sigmas * math.sqrt(total)
