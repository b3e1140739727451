"""Fits all profiles of a goal at once: the place of each piece of edge, and their common blur, light and noise."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra import cholesky
from robocup_vision.kernels.algebra.copies import copy_vector
from robocup_vision.kernels.goal.profile import (
    CHANNELS,
    LANES,
    MEMBERS,
    OWN,
    PER_MEMBER,
    SHARED,
    TOUCHED,
    ProfilePixels,
    ProfileUnknowns,
    pixel_model,
)

_MIN_BLUR_PX, _MAX_BLUR_PX = 0.35, 2.0
_CUT = 2.5  # of Cauchy's weights, in standard deviations
_CUT_BIAS = 0.79  # weighted mean square over variance of normal noise under these weights
_MAX_MOVE_PX = 0.7  # in one step
_STILL_PX = 0.02
_ALL = 4 + TOUCHED
_OF_MEMBER = CHANNELS + PER_MEMBER  # shared unknowns that one segment depends on


class ProfilePriors(NamedTuple):
    """Prior on the unknowns.

    Parameters
    ----------
    expected, weight : (SHARED,) float64
        Of the shared ones: values and inverse variances.
    move_std_px : float
        Of the edges' moves.
    """

    expected: FloatArray
    weight: FloatArray
    move_std_px: float


class _System(NamedTuple):
    """Normal equations, the segments' own unknowns apart: own (S, OWN, OWN), mixed, shared, and both right sides.

    `solved` (S, SHARED, OWN) holds the inverse of each segment's own block times its mixed block.
    """

    own: FloatArray
    mixed: FloatArray
    shared: FloatArray
    right_own: FloatArray
    right_shared: FloatArray
    solved: FloatArray


class _Noise(NamedTuple):
    """Estimate the noise by the residuals (N, 2).

    Parameters
    ----------
    residual : (N, 2) float64
        Of each pixel and channel.
    variance, inflation : (2,) float64
        Of each channel: of single pixels, and the part common to pixels one behind the other, as a factor.
    weights, squares : (2,) float64
        Sums of weights and of weighted squares.
    excess, seen : (S, 2) float64
        Of each side of a segment: squares in units of the variance, and of how many pixels.
    lanes : (S, LANES) float64
        Working memory: sums of residuals one behind the other.
    """

    residual: FloatArray
    variance: FloatArray
    inflation: FloatArray
    weights: FloatArray
    squares: FloatArray
    excess: FloatArray
    seen: FloatArray
    lanes: FloatArray


class _Sums(NamedTuple):
    """Sums over the pixels of one segment and channel.

    One pixel's derivatives and residual, weighted sums of their products, and the places of the shared and of the own
    unknowns that they are derivatives by.
    """

    slopes: FloatArray
    products: FloatArray
    shared_at: Int64Array
    own_at: Int64Array


@compiled
def _member_of(segment: int, pieces: int) -> int:
    """Which member a segment lies on; a foot on its post."""
    feet_from = MEMBERS * pieces
    return segment - feet_from if segment >= feet_from else segment // pieces


@compiled
def _shared_index(k: int, base: int) -> int:
    """Place of the k-th shared unknown that a segment depends on: the blurs, then its member's own."""
    return k if k < CHANNELS else base + k - CHANNELS


@compiled
def _start_with_priors(priors: ProfilePriors, unknowns: ProfileUnknowns, system: _System, noise: _Noise) -> None:
    """Set the normal equations to the priors alone, and the sums of the noise to nothing."""
    system.shared[:, :] = 0.0
    for i in range(SHARED):
        system.shared[i, i] = priors.weight[i]
        system.right_shared[i] = priors.weight[i] * (priors.expected[i] - unknowns.shared[i])
    for s in range(unknowns.own.shape[0]):
        system.own[s] = 0.0
        system.mixed[s] = 0.0
        noise.excess[s] = 0.0
        noise.seen[s] = 1e-9
        for i in range(OWN):
            system.own[s, i, i] = priors.move_std_px**-2 if i < 2 else 1e-6
            system.right_own[s, i] = -system.own[s, i, i] * unknowns.own[s, i]
    noise.weights[:] = 0.0
    noise.squares[:] = 0.0


@compiled
def _sum_pixels(
    pixels: ProfilePixels,
    span: tuple[int, int],
    unknowns: ProfileUnknowns,
    segment: tuple[int, int, bool],
    c: int,
    is_robust: bool,
    noise: _Noise,
    sums: _Sums,
) -> None:
    """Sum the products of derivatives over the pixels of one segment (its index, member, whether a foot), channel c."""
    s, member, is_foot = segment
    slopes, products = sums.slopes, sums.products
    products[:, :] = 0.0
    for n in range(span[0], span[1]):
        r = pixels.values[n, c] - pixel_model(pixels.places[n], is_foot, c, member, unknowns, s, slopes)
        noise.residual[n, c] = r
        scaled = r * r / noise.variance[c]
        w = 1.0 / (1.0 + scaled / _CUT**2) if is_robust else 1.0
        noise.weights[c] += w
        noise.squares[c] += w * r * r
        side = 0 if is_foot or pixels.places[n, 0] < pixels.places[n, 1] else 1
        noise.excess[s, side] += min(scaled, 30.0)
        noise.seen[s, side] += 1.0
        w /= noise.variance[c] * noise.inflation[c]
        slopes[_ALL] = r
        for i in range(_ALL):
            wi = w * slopes[i]
            if wi == 0.0:
                continue  # most pixels are far from one of the two edges
            for j in range(i, _ALL + 1):
                products[i, j] += wi * slopes[j]


@compiled
def _add_sums(sums: _Sums, s: int, base: int, c: int, system: _System) -> None:
    """Add the sums of one segment and channel to the normal equations."""
    products, index, mine = sums.products, sums.shared_at, sums.own_at
    index[0], index[1], index[2] = c, base, base + 1
    index[3], index[4] = base + 2 + 2 * c, base + 3 + 2 * c
    mine[0], mine[1], mine[2], mine[3] = 0, 1, 2 + 2 * c, 3 + 2 * c
    for i in range(4):
        system.right_own[s, mine[i]] += products[i, _ALL]
        for j in range(i + 1):
            system.own[s, mine[i], mine[j]] += products[j, i]
        for j in range(TOUCHED):
            system.mixed[s, mine[i], index[j]] += products[i, 4 + j]
    for i in range(TOUCHED):
        system.right_shared[index[i]] += products[4 + i, _ALL]
        for j in range(i + 1):
            system.shared[index[i], index[j]] += products[4 + j, 4 + i]


@compiled
def _update_noise(pixels: ProfilePixels, is_robust: bool, noise: _Noise) -> None:
    """Noise of single pixels, and the part common to those one behind the other, channel by channel."""
    lanes, residual = noise.lanes, noise.residual
    for c in range(CHANNELS):
        square = noise.squares[c] / max(noise.weights[c], 1e-9) / (_CUT_BIAS if is_robust else 1.0)
        noise.variance[c] = max(0.25, square)
        lanes[:, :] = 0.0
        below, above = 1e-9, 0.0
        for n in range(residual.shape[0]):
            if residual[n, c] ** 2 < _CUT**2 * noise.variance[c]:
                lanes[pixels.owner[n], pixels.lane[n]] += residual[n, c]
                below += residual[n, c] ** 2
        for s in range(lanes.shape[0]):
            for k in range(LANES):
                above += lanes[s, k] ** 2
        noise.inflation[c] = max(1.0, above / below)


@compiled
def _eliminate(first: Int64Array, pieces: int, system: _System) -> bool:
    """Eliminate the segments' own unknowns, and solve for the shared ones; False where a block is not definite."""
    solved, right_shared = system.solved, system.right_shared
    for s in range(first.shape[0] - 1):
        if first[s] == first[s + 1]:
            continue
        if not cholesky.factor(system.own[s], OWN):
            return False
        base = CHANNELS + PER_MEMBER * _member_of(s, pieces)
        for jj in range(_OF_MEMBER):
            j = _shared_index(jj, base)
            for i in range(OWN):
                solved[s, j, i] = system.mixed[s, i, j]
            cholesky.substitute(system.own[s], OWN, solved[s, j])
            for i in range(OWN):
                right_shared[j] -= solved[s, j, i] * system.right_own[s, i]
            for kk in range(jj + 1):
                k = _shared_index(kk, base)
                for i in range(OWN):
                    system.shared[j, k] -= solved[s, j, i] * system.mixed[s, i, k]
    if not cholesky.factor(system.shared, SHARED):
        return False
    cholesky.substitute(system.shared, SHARED, right_shared)
    return True


@compiled
def _step(first: Int64Array, pieces: int, system: _System, unknowns: ProfileUnknowns) -> float:
    """Move all unknowns by the solution; returns the greatest move that an edge was due, pixels."""
    farthest = 0.0
    right_own = system.right_own
    for s in range(first.shape[0] - 1):
        if first[s] == first[s + 1]:
            continue
        base = CHANNELS + PER_MEMBER * _member_of(s, pieces)
        cholesky.substitute(system.own[s], OWN, right_own[s])
        for i in range(OWN):
            for jj in range(_OF_MEMBER):
                j = _shared_index(jj, base)
                right_own[s, i] -= system.solved[s, j, i] * system.right_shared[j]
            step = right_own[s, i]
            unknowns.own[s, i] += min(_MAX_MOVE_PX, max(-_MAX_MOVE_PX, step)) if i < 2 else step
            if i < 2:
                farthest = max(farthest, abs(step))
    for i in range(SHARED):
        unknowns.shared[i] += system.right_shared[i]
    for c in range(CHANNELS):
        unknowns.shared[c] = min(_MAX_BLUR_PX, max(_MIN_BLUR_PX, unknowns.shared[c]))
    return farthest


@compiled
def _move_variances(first: Int64Array, pieces: int, system: _System, noise: _Noise, variance: FloatArray) -> None:
    """Set the variance of each segment's two moves, from the factors of the last step."""
    unit, back, alone = np.empty(SHARED), np.empty(SHARED), np.empty(OWN)
    for s in range(first.shape[0] - 1):
        variance[s, 0] = variance[s, 1] = np.inf
        if first[s] == first[s + 1]:
            continue
        base = CHANNELS + PER_MEMBER * _member_of(s, pieces)
        for i in range(2):
            alone[:] = 0.0
            alone[i] = 1.0
            cholesky.substitute(system.own[s], OWN, alone)
            unit[:] = 0.0
            for jj in range(_OF_MEMBER):
                j = _shared_index(jj, base)
                unit[j] = system.solved[s, j, i]
            copy_vector(unit, back)
            cholesky.substitute(system.shared, SHARED, back)
            variance[s, i] = alone[i]
            for j in range(SHARED):
                variance[s, i] += unit[j] * back[j]
            variance[s, i] *= max(1.0, noise.excess[s, i] / noise.seen[s, i])


@compiled
def _segment_starts(owner: Int64Array, segments: int) -> Int64Array:
    """First pixel of each segment, and their number (segments + 1,)."""
    first = np.zeros(segments + 1, np.int64)
    for n in range(owner.shape[0]):
        first[owner[n] + 1] += 1
    for s in range(segments):
        first[s + 1] += first[s]
    return first


@compiled
def fit_profiles(
    pixels: ProfilePixels,
    pieces: int,
    priors: ProfilePriors,
    rounds: int,
    unknowns: ProfileUnknowns,
    variance: FloatArray,
) -> bool:
    """Gauss-Newton on all unknowns, the segments' own eliminated first; Cauchy's weights at the noise's own scale.

    Noise common to pixels one behind the other (compression, clutter along an edge) is separated from independent
    noise, channel by channel. A segment side that does not fit the model gets a lower weight.

    Parameters
    ----------
    pixels, pieces
        See `gather_profiles`; sorted by owner.
    priors : ProfilePriors
        On the unknowns.
    rounds : int
        Of Gauss-Newton, at most; the first finds brightness and backgrounds only.
    unknowns : ProfileUnknowns
        Start (all of `own` and the brightnesses 0) and result.
    variance : (3 * pieces + 2, 2) float64
        Result: of the moves, pixels^2; infinite where there is no pixel.

    Returns
    -------
    bool
        False where the fit broke down.
    """
    count, segments = pixels.values.shape[0], unknowns.own.shape[0]
    sums = _Sums(np.empty(_ALL + 1), np.empty((_ALL, _ALL + 1)), np.empty(TOUCHED, np.int64), np.empty(4, np.int64))
    system = _System(
        np.empty((segments, OWN, OWN)),
        np.empty((segments, OWN, SHARED)),
        np.empty((SHARED, SHARED)),
        np.empty((segments, OWN)),
        np.empty(SHARED),
        np.empty((segments, SHARED, OWN)),
    )
    noise = _Noise(
        np.empty((count, CHANNELS)),
        np.ones(CHANNELS),
        np.ones(CHANNELS),
        np.zeros(CHANNELS),
        np.zeros(CHANNELS),
        np.zeros((segments, 2)),
        np.zeros((segments, 2)),
        np.empty((segments, LANES)),
    )
    first = _segment_starts(pixels.owner, segments)
    for turn in range(rounds):
        _start_with_priors(priors, unknowns, system, noise)
        for s in range(segments):
            segment = (s, _member_of(s, pieces), s >= MEMBERS * pieces)
            for c in range(CHANNELS):
                _sum_pixels(pixels, (first[s], first[s + 1]), unknowns, segment, c, turn > 0, noise, sums)
                _add_sums(sums, s, CHANNELS + PER_MEMBER * segment[1], c, system)
        _update_noise(pixels, turn > 0, noise)
        if not _eliminate(first, pieces, system):
            return False
        farthest = _step(first, pieces, system, unknowns)
        # the weights settle with the noise, two rounds after brightness and backgrounds are known
        if turn >= 2 and farthest < _STILL_PX:
            break
    _move_variances(first, pieces, system, noise, variance)
    return True
