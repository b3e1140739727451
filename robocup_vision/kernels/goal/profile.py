"""Posts and bar as blurred, shaded cylinders: their pixels, and what a camera with this blur and light should see.

A threshold half-way between paint and background lies off the edge wherever paint gets lighter or darker towards it, as
on every round post. Here the paint may be lighter to one side and towards the middle, its colour and its brightness are
two channels with a blur of their own, and what is left is where the edges are.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array, UInt8Array
from robocup_vision.compiling.loops import compiled, variable

CHANNELS = 2
MEMBERS = 3  # left post, right post, bar
# shared unknowns: blur of each channel; then for each member slope and curve of the paint across it, and for each
# channel its brightness and the slope of that along the member
PER_MEMBER = 2 + 2 * CHANNELS
SHARED = CHANNELS + MEMBERS * PER_MEMBER
# a segment's own: how far its two edges lie outside of where they were predicted (a foot has one), and for each channel
# the background on both sides (of a foot: the ground and the paint)
OWN = 2 + 2 * CHANNELS
TOUCHED = 5  # shared unknowns that one pixel depends on
LANES = 64


class ProfilePicture(NamedTuple):
    """The picture that profiles are read from.

    Parameters
    ----------
    image : (H, W, C) uint8
        What the channels are mixed from.
    mix : (2, C) float64
        Weight of each of the image's channels in colour and in brightness.
    shine : (H, W) uint8
        Non-zero where the sensor is saturated: such paint, and two pixels beside it, is left out.
    """

    image: UInt8Array
    mix: FloatArray
    shine: UInt8Array


class DueGoal(NamedTuple):
    """Where a goal is due in the picture.

    Parameters
    ----------
    edges : (6, 2) float64
        Predicted edges, left and right of both posts, upper and lower of the bar: `at` and `slope` of
        across = at + slope * along, pixels.
    spans : (3, 2) float64
        Where each member stands free: rows of the posts, columns of the bar.
    arcs : (2, 3) float64
        Row of each post's foot at s from -1 (left) to 1: a polynomial of the second degree.
    """

    edges: FloatArray
    spans: FloatArray
    arcs: FloatArray


class ProfileSpread(NamedTuple):
    """What is taken: most segments of a member, pixels of background, most rows (bar: columns) of a segment."""

    pieces: int
    reach_px: float
    max_lines: int


class ProfilePixels(NamedTuple):
    """The gathered pixels.

    Parameters
    ----------
    values : (N, 2) float64
        Both channels.
    places : (N, 4) float64
        Pixels inside of the first and the second edge and of the foot (0 elsewhere), place along (-1 to 1).
    owner, lane : (N,) int64
        Segment (3 * pieces and the next are the feet), and which pixels lie one behind the other in it.
    middle : (3 * pieces + 2,) float64
        Middles of the segments along their members, NaN where there is none.
    """

    values: FloatArray
    places: FloatArray
    owner: Int64Array
    lane: Int64Array
    middle: FloatArray


class ProfileUnknowns(NamedTuple):
    """The unknowns: those common to all profiles (SHARED,), and each segment's own (segments, OWN), float64."""

    shared: FloatArray
    own: FloatArray


@compiled
def normal_cdf(z: float) -> tuple[float, float]:
    """Cumulative normal distribution, to 1e-7 (Abramowitz and Stegun, 7.1.26), and its density."""
    if z > 5.0:
        return 1.0, 0.0
    if z < -5.0:
        return 0.0, 0.0
    e = math.exp(-0.5 * z * z)
    t = 1.0 / (1.0 + 0.3275911 * abs(z) * 0.7071067811865476)
    tail = t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429))))
    tail *= 0.5 * e
    return (1.0 - tail if z > 0.0 else tail), 0.3989422804014327 * e


@compiled
def _mix_pixel(image: UInt8Array, row: int, column: int, mix: FloatArray, value: FloatArray) -> None:
    """Mix one pixel's channels (C,) into a value (2,)."""
    for c in range(CHANNELS):
        value[c] = 0.0
        for k in range(image.shape[2]):
            value[c] += mix[c, k] * image[row, column, k]


@compiled
def _gather_member(
    picture: ProfilePicture, due: DueGoal, spread: ProfileSpread, member: int, pixels: ProfilePixels, n: int
) -> int:
    """Add the pixels across one member in segments along it; returns how many pixels there are now."""
    image, shine, edges = picture.image, picture.shine, due.edges
    height, width = image.shape[0], image.shape[1]
    pieces, reach_px = spread.pieces, spread.reach_px
    values, places = pixels.values, pixels.places
    upright = member < 2
    low, high = due.spans[member, 0], due.spans[member, 1]
    if not high - low >= 2.0:
        return n
    count = min(pieces, max(1, int((high - low) / 5.0)))
    first, last = max(0, int(math.ceil(low))), int(math.floor(high))
    last = min(last, (height if upright else width) - 1)
    most = (width if upright else height) - 1
    stride = max(1, int(math.ceil((last - first + 1) / (count * spread.max_lines))))
    cos_a = 1.0 / math.sqrt(1.0 + edges[2 * member, 1] ** 2)
    cos_b = 1.0 / math.sqrt(1.0 + edges[2 * member + 1, 1] ** 2)
    for k in range(count):
        pixels.middle[member * pieces + k] = low + (k + 0.5) * (high - low) / count
    for i in range(first, last + 1, stride):
        segment = member * pieces + min(count - 1, max(0, int(count * (i - low) / (high - low))))
        a = edges[2 * member, 0] + edges[2 * member, 1] * i
        b = edges[2 * member + 1, 0] + edges[2 * member + 1, 1] * i
        j0, j1 = max(0, int(math.ceil(a - reach_px))), min(most, int(math.floor(b + reach_px)))
        free_from = -1
        for j in range(j0, j1 + 1):
            # paint that shines hides what is beside it: look two pixels ahead, and skip as many behind
            if j + 2 <= j1 and a + 0.5 < j + 2 < b - 0.5 and (shine[i, j + 2] if upright else shine[j + 2, i]) > 0:
                free_from = j + 5
            if j == j0:
                for m in (j0, j0 + 1):
                    if m <= j1 and a + 0.5 < m < b - 0.5 and (shine[i, m] if upright else shine[m, i]) > 0:
                        free_from = m + 3
            if j < free_from:
                continue
            # deep inside a wide member every fourth pixel is enough for its brightness
            if j - a > 4.0 and b - j > 4.0 and j % 4 != 0:
                continue
            if n >= values.shape[0]:
                return n
            _mix_pixel(image, i if upright else j, j if upright else i, picture.mix, values[n])
            places[n, 0], places[n, 1], places[n, 2] = (j - a) * cos_a, (b - j) * cos_b, 0.0
            places[n, 3] = 2.0 * (i - 0.5 * (low + high)) / (high - low)
            pixels.owner[n], pixels.lane[n] = segment, j % LANES
            n += 1
    return n


@compiled
def _gather_foot(picture: ProfilePicture, due: DueGoal, pieces: int, post: int, pixels: ProfilePixels, n: int) -> int:
    """Add the pixels around one post's foot; returns how many pixels there are now."""
    image, shine, edges, arcs = picture.image, picture.shine, due.edges, due.arcs
    height, width = image.shape[0], image.shape[1]
    values, places = pixels.values, pixels.places
    segment = MEMBERS * pieces + post
    foot = arcs[post, 0] + abs(arcs[post, 2]) + abs(arcs[post, 1])
    pixels.middle[segment] = arcs[post, 0]
    for i in range(max(0, int(math.ceil(foot - 4.0))), min(height - 1, int(math.floor(foot + 3.5))) + 1):
        a = edges[2 * post, 0] + edges[2 * post, 1] * i
        b = edges[2 * post + 1, 0] + edges[2 * post + 1, 1] * i
        half = 0.5 * (b - a)
        # the flanks show what is beside it as well
        keep = max(0.45 * half, 0.6)
        j0, j1 = max(0, int(math.ceil(a + half - keep))), min(width - 1, int(math.floor(b - half + keep)))
        lit = False
        for j in range(j0, j1 + 1):
            lit = lit or (i < foot and shine[i, j] > 0)
        if lit:
            continue
        for j in range(j0, j1 + 1, max(1, (j1 - j0 + 1) // 8)):
            if n >= values.shape[0]:
                return n
            s = min(1.0, max(-1.0, (j - a) / half - 1.0))
            steep = (arcs[post, 1] + 2.0 * arcs[post, 2] * s) / half
            row = arcs[post, 0] + (arcs[post, 1] + arcs[post, 2] * s) * s
            _mix_pixel(image, i, j, picture.mix, values[n])
            places[n, 0], places[n, 1], places[n, 3] = j - a, b - j, 1.0
            places[n, 2] = (row - i) / math.sqrt(1.0 + steep * steep)
            pixels.owner[n], pixels.lane[n] = segment, i % LANES
            n += 1
    return n


@compiled
def gather_profiles(picture: ProfilePicture, due: DueGoal, spread: ProfileSpread, pixels: ProfilePixels) -> int:
    """Pixels across every member in segments along it, and those around both feet.

    Parameters
    ----------
    picture, due, spread
        What is read, where the goal is due in it, and how many pixels are taken.
    pixels : ProfilePixels
        Results, as far as there is room.

    Returns
    -------
    int
        How many pixels there are.
    """
    pixels.middle[:] = np.nan
    n = variable(0)
    for member in range(MEMBERS):
        n = _gather_member(picture, due, spread, member, pixels, n)
    for post in range(2):
        n = _gather_foot(picture, due, spread.pieces, post, pixels, n)
    return n


@compiled
def pixel_model(
    place: FloatArray,
    is_foot: bool,
    channel: int,
    member: int,
    unknowns: ProfileUnknowns,
    segment: int,
    slopes: FloatArray,
) -> float:
    """Predict one pixel, with derivatives.

    The paint's light is a polynomial of the second degree in s, -1 to 1 across the member, which comes near Lambert's
    cylinder; blurred by a normal distribution it has a closed form.

    Parameters
    ----------
    place : (4,) float64
        One of `ProfilePixels.places`.
    is_foot : bool
        A pixel around a foot.
    channel, member : int
        Of the pixel.
    unknowns : ProfileUnknowns
        There.
    segment : int
        That the pixel belongs to.
    slopes : (9 or more,) float64
        Results: derivatives by both moves and both backgrounds of this channel; by its blur, the member's slope and
        curve, and the channel's brightness and its slope.
    """
    shared, own = unknowns
    base = CHANNELS + PER_MEMBER * member
    blur, across, curve = shared[channel], shared[base], shared[base + 1]
    bright, along = shared[base + 2 + 2 * channel], shared[base + 3 + 2 * channel]
    ground_a, ground_b = own[segment, 2 + 2 * channel], own[segment, 3 + 2 * channel]
    sharp = 1.0 / blur
    if is_foot:
        z = (place[2] + own[segment, 0]) * sharp
        lower, pf = normal_cdf(z)
        step = (ground_b - ground_a) * pf * sharp
        slopes[0], slopes[1], slopes[2], slopes[3] = step, 0.0, 1.0 - lower, lower
        slopes[4], slopes[5], slopes[6], slopes[7], slopes[8] = -step * z, 0.0, 0.0, 0.0, 0.0
        return float(ground_a + (ground_b - ground_a) * lower)
    da, db = place[0] + own[segment, 0], place[1] + own[segment, 1]
    half, x = 0.5 * (da + db), 0.5 * (da - db)
    thin = 1.0 / half
    ca, pa = normal_cdf(da * sharp)
    cb, pb = normal_cdf(db * sharp)
    cover = ca + cb - 1.0
    first = (x * cover + blur * (pa - pb)) * thin
    second = ((x * x + blur * blur) * cover + blur * ((x - half) * pa - (x + half) * pb)) * thin * thin
    shade = 1.0 + along * place[3]
    gain = bright * shade
    shape = cover + across * first + curve * second
    step_a = (gain * (1.0 - across + curve) - ground_a) * pa * sharp
    step_b = (gain * (1.0 + across + curve) - ground_b) * pb * sharp
    slopes[0], slopes[1], slopes[2], slopes[3] = step_a, step_b, 1.0 - ca, 1.0 - cb
    slopes[4], slopes[5], slopes[6] = -(step_a * da + step_b * db) * sharp, gain * first, gain * second
    slopes[7], slopes[8] = shade * shape, bright * place[3] * shape
    return float(gain * shape + ground_a * (1.0 - ca) + ground_b * (1.0 - cb))
