"""Posts, bar and feet in whole rows and columns of the picture, as a camera with this point spread should see them.

A pixel is the light of its own square, spread by lens and demosaicing. What it shows of an edge depends on where the
edge lies within it: a model of another shape puts edges off by up to a tenth of a pixel, alike along a stretch of an
upright post. A section is one row across a post, or one column across the bar or a foot, not interpolated; its
levels are its own, so that neither light, glare nor what stands behind matters beyond it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array, UInt8Array
from robocup_vision.compiling.loops import compiled, variable
from robocup_vision.kernels.algebra import cholesky

CHANNELS = 2
COLOR, BRIGHTNESS = range(CHANNELS)
MEMBERS = 3  # left post, right post, bar
BAR = 2
KINDS = 5  # of sections: those across the members, then those down to the left and the right foot
# levels of a section in one channel: both backgrounds, and the parts of the paint's light (see `SHAPES`)
SHAPES = 4
LEVELS = 2 + SHAPES
_ROOM = 24  # pixels of a section at most


class SectionPicture(NamedTuple):
    """The picture that sections are read from.

    Parameters
    ----------
    image : (H, W, C) uint8
        What the channels are mixed from.
    mix : (2, C) float64
        Weight of each of the image's channels in colour and in brightness.
    saturated : int
        Level from which a pixel of the paint shines: it and two pixels beside it are left out.
    """

    image: UInt8Array
    mix: FloatArray
    saturated: int


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


class SectionSpread(NamedTuple):
    """What is taken: most pieces of a member and rows (bar: columns) of a piece; pixels outside and inside an edge."""

    pieces: int
    max_lines: int
    outside_px: float
    inside_px: float


class Sections(NamedTuple):
    """The gathered sections.

    Parameters
    ----------
    values : (N, 3) float64
        Both channels of all pixels, section by section, and whether they count.
    first : (S + 1,) int64
        First pixel of each section.
    place : (S, 3) float64
        Place of its first pixel across, and of both edges as predicted.
    line, kind, piece : (S,) int64
        Row or column that it is, what it crosses, and the piece that it belongs to: 3 * pieces and the next are the
        feet.
    middle : (3 * pieces + 2,) float64
        Middles of the pieces along their members (feet: the columns of their middles), NaN where there is none.
    """

    values: FloatArray
    first: Int64Array
    place: FloatArray
    line: Int64Array
    kind: Int64Array
    piece: Int64Array
    middle: FloatArray


class Response(NamedTuple):
    """What is known of paint and optics.

    Parameters
    ----------
    edge : (2 * K, 2) float64
        Light of a step, and its derivative, at the pixels -reach to reach behind it, for one point spread; of pixels
        with even places, then with odd ones.
    per_px : float
        Entries to a pixel.
    knots : (M,) float64
        Where the paint's light is taken to change, 0 to 1 across a member.
    jumps : (SHAPES, M) float64
        By how much it does there, for each of its parts.
    levels : (KINDS,) int64
        How many levels a section of each kind has: backgrounds and the first parts of the paint's light.
    tightness : (LEVELS,) float64
        Inverse variance of the levels about 0, grey levels.
    """

    edge: FloatArray
    per_px: float
    knots: FloatArray
    jumps: FloatArray
    levels: Int64Array
    tightness: FloatArray


@compiled
def _add_section(
    picture: SectionPicture,
    upright: bool,
    line: int,
    low: int,
    high: int,
    paint: tuple[float, float],
    sections: Sections,
    s: int,
) -> bool:
    """Add the pixels `low` to `high` of a row (upright) or column; False where there is no room or nothing to see."""
    image, mix = picture.image, picture.mix
    most = (image.shape[1] if upright else image.shape[0]) - 1
    if low < 0 or high > most or s + 1 >= sections.first.shape[0]:
        return False
    n = sections.first[s]
    if high - low + 1 > _ROOM or n + high - low + 1 > sections.values.shape[0]:
        return False
    start = n
    for j in range(low, high + 1):
        sections.values[start + j - low, CHANNELS] = 1.0
    for j in range(low, high + 1):
        row, column = (line, j) if upright else (j, line)
        if paint[0] + 0.5 < j < paint[1] - 0.5:
            shines = False
            for k in range(image.shape[2]):
                shines |= image[row, column, k] >= picture.saturated
            if shines:
                for beside in range(max(low, j - 2), min(high, j + 2) + 1):
                    sections.values[start + beside - low, CHANNELS] = 0.0
        for c in range(CHANNELS):
            value = 0.0
            for k in range(image.shape[2]):
                value += mix[c, k] * image[row, column, k]
            sections.values[n, c] = value
        n += 1
    sections.first[s + 1] = n
    sections.place[s, 0] = low
    return True


@compiled
def _gather_member(
    picture: SectionPicture, due: DueGoal, spread: SectionSpread, member: int, sections: Sections, s: int
) -> int:
    """Add the sections of one member; returns how many there are now."""
    edges, upright = due.edges, member < 2
    low, high = due.spans[member, 0], due.spans[member, 1]
    if not high - low >= 2.0:
        return s
    count = min(spread.pieces, max(1, int((high - low) / 5.0)))
    most = (picture.image.shape[0] if upright else picture.image.shape[1]) - 1
    first, last = max(0, int(math.ceil(low))), min(most, int(math.floor(high)))
    stride = max(1, int(math.ceil((last - first + 1) / (count * spread.max_lines))))
    for k in range(count):
        sections.middle[member * spread.pieces + k] = low + (k + 0.5) * (high - low) / count
    for i in range(first, last + 1, stride):
        piece = member * spread.pieces + min(count - 1, max(0, int(count * (i - low) / (high - low))))
        a = edges[2 * member, 0] + edges[2 * member, 1] * i
        b = edges[2 * member + 1, 0] + edges[2 * member + 1, 1] * i
        is_wide = b - a > 2.0 * spread.inside_px
        for side in range(2 if is_wide else 1):
            # across a wide member only what is near its edges counts
            j0 = int(math.ceil(b - spread.inside_px if side == 1 else a - spread.outside_px))
            j1 = int(math.floor(a + spread.inside_px if is_wide and side == 0 else b + spread.outside_px))
            if _add_section(picture, upright, i, j0, j1, (a, b), sections, s):
                sections.place[s, 1], sections.place[s, 2] = a, b
                sections.line[s], sections.kind[s], sections.piece[s] = i, member, piece
                s += 1
    return s


@compiled
def _gather_foot(
    picture: SectionPicture, due: DueGoal, spread: SectionSpread, post: int, sections: Sections, s: int
) -> int:
    """Add the columns around the middle of one post's foot; returns how many sections there are now."""
    edges, arcs = due.edges, due.arcs
    piece = MEMBERS * spread.pieces + post
    row = arcs[post, 0]
    a = edges[2 * post, 0] + edges[2 * post, 1] * row
    b = edges[2 * post + 1, 0] + edges[2 * post + 1, 1] * row
    half = 0.5 * (b - a)
    sections.middle[piece] = 0.5 * (a + b)
    # the flanks show what is beside it as well
    keep = max(0.45 * half, 0.6)
    j0, j1 = max(0, int(math.ceil(a + half - keep))), int(math.floor(b - half + keep))
    for j in range(j0, min(picture.image.shape[1] - 1, j1) + 1, max(1, (j1 - j0 + 1) // 8)):
        across = min(1.0, max(-1.0, (j - a) / half - 1.0))
        foot = arcs[post, 0] + (arcs[post, 1] + arcs[post, 2] * across) * across
        # the paint goes on beyond what is read
        top = foot - 2.0 * (spread.inside_px + spread.outside_px)
        low, high = int(math.ceil(foot - spread.inside_px)), int(math.floor(foot + spread.outside_px))
        if _add_section(picture, False, j, low, high, (top, foot), sections, s):
            sections.place[s, 1], sections.place[s, 2] = top, foot
            sections.line[s], sections.kind[s], sections.piece[s] = j, MEMBERS + post, piece
            s += 1
    return s


@compiled
def gather_sections(picture: SectionPicture, due: DueGoal, spread: SectionSpread, sections: Sections) -> int:
    """Rows across both posts, columns across the bar, and those that end at the feet.

    Parameters
    ----------
    picture, due, spread
        What is read, where the goal is due in it, and how much is taken.
    sections : Sections
        Results, as far as there is room.

    Returns
    -------
    int
        How many sections there are.
    """
    sections.middle[:] = np.nan
    sections.first[0] = 0
    s = variable(0)
    for member in range(MEMBERS):
        s = _gather_member(picture, due, spread, member, sections, s)
    for post in range(2):
        s = _gather_foot(picture, due, spread, post, sections, s)
    return s


class _Work(NamedTuple):
    """Working memory of one section: its pixels that count, design and density by column, and small matrices.

    The pixels come last in every array, so that arithmetic on them runs side by side.
    """

    entry: Int64Array
    pixels: FloatArray  # light beyond an edge, value, both moves' derivatives
    design: FloatArray
    density: FloatArray
    normal: FloatArray
    levels: FloatArray
    mixed: FloatArray
    solved: FloatArray


@compiled
def _work(cells: int) -> _Work:
    return _Work(
        np.empty(_ROOM, np.int64),
        np.empty((5, _ROOM)),
        np.empty((LEVELS, _ROOM)),
        np.empty((cells, _ROOM)),
        np.empty((LEVELS, LEVELS)),
        np.empty(LEVELS),
        np.empty((2, LEVELS)),
        np.empty((2, LEVELS)),
    )


@compiled(fastmath={"reassoc", "contract"})
def _product(a: FloatArray, b: FloatArray, n: int) -> float:
    total = 0.0
    for i in range(n):
        total += a[i] * b[i]
    return total


@compiled
def _design(sections: Sections, s: int, c: int, response: Response, work: _Work) -> int:
    """Write values, design and density of a section's pixels that count; returns how many there are."""
    edge, knots, jumps = response.edge, response.knots, response.jumps
    light, at, value = work.pixels[0], work.pixels[1], work.pixels[2]
    first, count = sections.first[s], sections.first[s + 1] - sections.first[s]
    a, b = sections.place[s, 1], sections.place[s, 2]
    many, half, cells = response.levels[sections.kind[s]], edge.shape[0] // 2, knots.shape[0]
    origin, top = 0.5 * (half - 1), half - 1 - 1e-6
    n = 0
    for i in range(count):
        if sections.values[first + i, CHANNELS] != 0.0:
            place = sections.place[s, 0] + i
            work.entry[n] = half * (int(place) & 1)
            at[n], value[n] = origin + (place - a) * response.per_px, sections.values[first + i, c]
            n += 1
    work.design[2:many, :n] = 0.0
    for m in range(cells):
        shift, density = (b - a) * knots[m] * response.per_px, work.density[m]
        for i in range(n):
            place = min(max(at[i] - shift, 0.0), top)
            entry = int(place)
            part = place - entry
            entry += work.entry[i]
            light[i] = edge[entry, 0] + part * (edge[entry + 1, 0] - edge[entry, 0])
            density[i] = edge[entry, 1] + part * (edge[entry + 1, 1] - edge[entry, 1])
        for k in range(2, many):
            design, jump = work.design[k], jumps[k - 2, m]
            for i in range(n):
                design[i] += jump * light[i]
        if m == 0:
            for i in range(n):
                work.design[0, i] = 1.0 - light[i]
        elif m == cells - 1:
            for i in range(n):
                work.design[1, i] = light[i]
    return n


@compiled
def _fit_section(
    sections: Sections, s: int, c: int, response: Response, variance: float, work: _Work
) -> tuple[float, float, float, float, float, float, float]:
    """Fit one section's levels in one channel.

    Returns how many values are left over, their squared residuals, what the levels leave of the information about both
    moves (three values) and of its gradient (two), in units of the squared grey level.
    """
    design, density, normal, levels = work.design, work.density, work.normal, work.levels
    knots, jumps, tight = response.knots, response.jumps, response.tightness
    r, da, db = work.pixels[2], work.pixels[3], work.pixels[4]
    many, cells = response.levels[sections.kind[s]], knots.shape[0]
    n = _design(sections, s, c, response, work)
    for k in range(many):
        levels[k] = _product(design[k], r, n)
        for j in range(k + 1):
            normal[k, j] = _product(design[k], design[j], n)
        normal[k, k] += variance * tight[k]
    if not cholesky.factor(normal, many):
        return 1.0, np.inf, 0.0, 0.0, 0.0, 0.0, 0.0
    cholesky.substitute(normal, many, levels)
    for i in range(n):
        da[i], db[i] = levels[0] * density[0, i], -levels[1] * density[cells - 1, i]
    for m in range(cells):
        shade = 0.0
        for k in range(2, many):
            shade += levels[k] * jumps[k - 2, m]
        of_a, of_b, here = shade * (1.0 - knots[m]), shade * knots[m], density[m]
        for i in range(n):
            da[i] -= of_a * here[i]
            db[i] -= of_b * here[i]
    for k in range(many):
        here, level = design[k], levels[k]
        for i in range(n):
            r[i] -= level * here[i]
        work.mixed[0, k], work.mixed[1, k] = _product(da, here, n), _product(db, here, n)
        work.solved[:, k] = work.mixed[:, k]
    squares, ga, gb = _product(r, r, n), _product(da, r, n), _product(db, r, n)
    aa, ab, bb = _product(da, da, n), _product(da, db, n), _product(db, db, n)
    for j in range(2):
        cholesky.substitute(normal, many, work.solved[j])
    for k in range(many):
        aa -= work.mixed[0, k] * work.solved[0, k]
        ab -= work.mixed[0, k] * work.solved[1, k]
        bb -= work.mixed[1, k] * work.solved[1, k]
        squares += variance * tight[k] * levels[k] ** 2
    return max(1.0, float(n - many)), squares, aa, ab, bb, ga, gb


@compiled
def fit_sections(
    sections: Sections,
    every: int,
    responses: tuple[Response, Response, Response, Response],
    variance: FloatArray,
    evidence: FloatArray,
    misfit: FloatArray,
) -> None:
    """Fit the levels of sections where their edges are taken to be, and sum up what is left of them about the edges.

    Parameters
    ----------
    sections : Sections
        See `gather_sections`.
    every : int
        One section in so many is fitted.
    responses : tuple of Response
        For rows in colour and brightness, then for columns.
    variance : (2, 2) float64
        Of a pixel's noise in rows and columns, by channel, about as it is.
    evidence : (S, 2, 5) float64
        Results: information (aa, ab, bb) and gradient (a, b) of each section and channel, pixels and grey levels.
    misfit : (S, 2) float64
        Results: squared residuals of each section for each value left over.
    """
    work = _work(responses[0].knots.shape[0])
    for s in range(0, evidence.shape[0], every):
        axis = 0 if sections.kind[s] < BAR else 1
        for c in range(CHANNELS):
            noise = variance[axis, c]
            left, squares, aa, ab, bb, ga, gb = _fit_section(sections, s, c, responses[2 * axis + c], noise, work)
            misfit[s, c] = squares / left
            evidence[s, c, 0], evidence[s, c, 1], evidence[s, c, 2] = aa, ab, bb
            evidence[s, c, 3], evidence[s, c, 4] = ga, gb


@compiled
def spread_cost(
    sections: Sections, which: Int64Array, c: int, response: Response, variance: float, least: float, move_std: float
) -> float:
    """Negative log-likelihood of sections under one point spread, each with an unknown noise and edges that move.

    Parameters
    ----------
    sections : Sections
        See `gather_sections`.
    which : (K,) int64
        Those that count: all rows or all columns.
    c : int
        Channel.
    response : Response
        Of the point spread.
    variance, least : float
        Of a pixel's noise: about as it is, and at least.
    move_std : float
        How well the edges' places are known, pixels.
    """
    work = _work(response.knots.shape[0])
    cost = 0.0
    prior = variance / move_std**2
    for s in which:
        left, squares, aa, ab, bb, ga, gb = _fit_section(sections, s, c, response, variance, work)
        aa += prior
        bb += prior
        gain = (bb * ga * ga - 2.0 * ab * ga * gb + aa * gb * gb) / (aa * bb - ab * ab)
        cost += 0.5 * left * math.log(least + max(0.0, squares - gain) / left)
    return cost
