"""All profiles of a goal in one fit: where each piece of edge lies, and the blur, light and noise they share."""

from __future__ import annotations

import numpy as np
from numba import njit

from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.kernels.algebra import cholesky
from robocup_vision.kernels.goal.profile import CHANNELS, LANES, MEMBERS, OWN, PER_MEMBER, SHARED, TOUCHED, pixel_model

_MIN_BLUR_PX, _MAX_BLUR_PX = 0.35, 2.0
_CUT = 2.5  # of Cauchy's weights, in standard deviations
_CUT_BIAS = 0.79  # weighted mean square over variance of normal noise under these weights
_MAX_MOVE_PX = 0.7  # in one step
_STILL_PX = 0.02
_ALL = 4 + TOUCHED


@njit(cache=True, nogil=True)
def fit_profiles(
    values: FloatArray,
    places: FloatArray,
    owner: Int64Array,
    lane: Int64Array,
    pieces: int,
    expected: FloatArray,
    weight: FloatArray,
    move_std_px: float,
    rounds: int,
    shared: FloatArray,
    own: FloatArray,
    variance: FloatArray,
) -> bool:
    """Gauss-Newton on all unknowns, the segments' own eliminated first; Cauchy's weights at the noise's own scale.

    Noise that pixels one behind the other share (compression, clutter along an edge) is told from noise that they do
    not, channel by channel, and a segment side that is not what the model says counts for as much less.

    Parameters
    ----------
    values, places, owner, lane, pieces
        See `gather_profiles`; sorted by owner.
    expected, weight : (SHARED,) float64
        Prior on the shared unknowns: values and inverse variances.
    move_std_px : float
        Prior on the edges' moves.
    rounds : int
        Of Gauss-Newton, at most; the first finds brightness and backgrounds only.
    shared, own : (SHARED,), (3 * pieces + 2, OWN) float64
        The unknowns: start (all of `own` and the brightnesses 0) and result.
    variance : (3 * pieces + 2, 2) float64
        Result: of the moves, pixels^2; infinite where there is no pixel.

    Returns
    -------
    bool
        False where the fit broke down.
    """
    count, segments = values.shape[0], own.shape[0]
    feet_from = MEMBERS * pieces
    # of one segment and channel: its own four unknowns, the shared ones, the residual; weighted sums of their products
    slopes, sums = np.empty(_ALL + 1), np.empty((_ALL, _ALL + 1))
    index, mine = np.empty(TOUCHED, np.int64), np.empty(4, np.int64)
    a, b = np.empty((segments, OWN, OWN)), np.empty((segments, OWN, SHARED))
    g, right_g = np.empty((SHARED, SHARED)), np.empty(SHARED)
    right_a, solved = np.empty((segments, OWN)), np.empty((segments, SHARED, OWN))
    residual = np.empty((count, CHANNELS))
    first = np.zeros(segments + 1, np.int64)
    strange, asked = np.zeros((segments, 2)), np.zeros((segments, 2))
    lanes = np.empty((segments, LANES))
    noise2, inflation = np.ones(CHANNELS), np.ones(CHANNELS)
    for n in range(count):
        first[owner[n] + 1] += 1
    for s in range(segments):
        first[s + 1] += first[s]
    for turn in range(rounds):
        g[:, :] = 0.0
        for i in range(SHARED):
            g[i, i] = weight[i]
            right_g[i] = weight[i] * (expected[i] - shared[i])
        for s in range(segments):
            a[s] = 0.0
            b[s] = 0.0
            strange[s] = 0.0
            asked[s] = 1e-9
            for i in range(OWN):
                a[s, i, i] = move_std_px**-2 if i < 2 else 1e-6
                right_a[s, i] = -a[s, i, i] * own[s, i]
        sum_w, sum_r = np.zeros(CHANNELS), np.zeros(CHANNELS)
        for s in range(segments):
            is_foot = s >= feet_from
            member = s - feet_from if is_foot else s // pieces
            base = CHANNELS + PER_MEMBER * member
            for c in range(CHANNELS):
                sums[:, :] = 0.0
                for n in range(first[s], first[s + 1]):
                    r = values[n, c] - pixel_model(places, n, is_foot, c, member, shared, own, s, slopes)
                    residual[n, c] = r
                    scaled = r * r / noise2[c]
                    w = 1.0 / (1.0 + scaled / _CUT**2) if turn > 0 else 1.0
                    sum_w[c] += w
                    sum_r[c] += w * r * r
                    side = 0 if is_foot or places[n, 0] < places[n, 1] else 1
                    strange[s, side] += min(scaled, 30.0)
                    asked[s, side] += 1.0
                    w /= noise2[c] * inflation[c]
                    slopes[_ALL] = r
                    for i in range(_ALL):
                        wi = w * slopes[i]
                        if wi == 0.0:
                            continue  # most pixels are far from one of the two edges
                        for j in range(i, _ALL + 1):
                            sums[i, j] += wi * slopes[j]
                index[0], index[1], index[2] = c, base, base + 1
                index[3], index[4] = base + 2 + 2 * c, base + 3 + 2 * c
                mine[0], mine[1], mine[2], mine[3] = 0, 1, 2 + 2 * c, 3 + 2 * c
                for i in range(4):
                    right_a[s, mine[i]] += sums[i, _ALL]
                    for j in range(i + 1):
                        a[s, mine[i], mine[j]] += sums[j, i]
                    for j in range(TOUCHED):
                        b[s, mine[i], index[j]] += sums[i, 4 + j]
                for i in range(TOUCHED):
                    right_g[index[i]] += sums[4 + i, _ALL]
                    for j in range(i + 1):
                        g[index[i], index[j]] += sums[4 + j, 4 + i]
        for c in range(CHANNELS):
            noise2[c] = max(0.25, sum_r[c] / max(sum_w[c], 1e-9) / (_CUT_BIAS if turn > 0 else 1.0))
            lanes[:, :] = 0.0
            below, above = 1e-9, 0.0
            for n in range(count):
                if residual[n, c] ** 2 < _CUT**2 * noise2[c]:
                    lanes[owner[n], lane[n]] += residual[n, c]
                    below += residual[n, c] ** 2
            for s in range(segments):
                for k in range(LANES):
                    above += lanes[s, k] ** 2
            inflation[c] = max(1.0, above / below)
        for s in range(segments):
            if first[s] == first[s + 1]:
                continue
            if not cholesky.factor(a[s], OWN):
                return False
            member = s - feet_from if s >= feet_from else s // pieces
            base = CHANNELS + PER_MEMBER * member
            for jj in range(CHANNELS + PER_MEMBER):
                j = jj if jj < CHANNELS else base + jj - CHANNELS
                for i in range(OWN):
                    solved[s, j, i] = b[s, i, j]
                cholesky.substitute(a[s], OWN, solved[s, j])
                for i in range(OWN):
                    right_g[j] -= solved[s, j, i] * right_a[s, i]
                for kk in range(jj + 1):
                    k = kk if kk < CHANNELS else base + kk - CHANNELS
                    for i in range(OWN):
                        g[j, k] -= solved[s, j, i] * b[s, i, k]
        if not cholesky.factor(g, SHARED):
            return False
        cholesky.substitute(g, SHARED, right_g)
        farthest = 0.0
        for s in range(segments):
            if first[s] == first[s + 1]:
                continue
            member = s - feet_from if s >= feet_from else s // pieces
            base = CHANNELS + PER_MEMBER * member
            cholesky.substitute(a[s], OWN, right_a[s])
            for i in range(OWN):
                for jj in range(CHANNELS + PER_MEMBER):
                    j = jj if jj < CHANNELS else base + jj - CHANNELS
                    right_a[s, i] -= solved[s, j, i] * right_g[j]
                step = right_a[s, i]
                own[s, i] += min(_MAX_MOVE_PX, max(-_MAX_MOVE_PX, step)) if i < 2 else step
                if i < 2:
                    farthest = max(farthest, abs(step))
        for i in range(SHARED):
            shared[i] += right_g[i]
        for c in range(CHANNELS):
            shared[c] = min(_MAX_BLUR_PX, max(_MIN_BLUR_PX, shared[c]))
        # the weights settle with the noise, two rounds after brightness and backgrounds are known
        if turn >= 2 and farthest < _STILL_PX:
            break
    unit, back, alone = np.empty(SHARED), np.empty(SHARED), np.empty(OWN)
    for s in range(segments):
        variance[s, 0] = variance[s, 1] = np.inf
        if first[s] == first[s + 1]:
            continue
        member = s - feet_from if s >= feet_from else s // pieces
        base = CHANNELS + PER_MEMBER * member
        for i in range(2):
            alone[:] = 0.0
            alone[i] = 1.0
            cholesky.substitute(a[s], OWN, alone)
            unit[:] = 0.0
            for jj in range(CHANNELS + PER_MEMBER):
                j = jj if jj < CHANNELS else base + jj - CHANNELS
                unit[j] = solved[s, j, i]
            back[:] = unit
            cholesky.substitute(g, SHARED, back)
            variance[s, i] = alone[i]
            for j in range(SHARED):
                variance[s, i] += unit[j] * back[j]
            variance[s, i] *= max(1.0, strange[s, i] / asked[s, i])
    return True
