"""One fit of pose, tilt, roll and height to candidates along normals, with a prior as a factor.

The unknowns are standard normal under the prior, so that an unknown that the prior fixes needs no special case.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.compiling.loops import compiled, variable
from robocup_vision.kernels.algebra.cholesky import factor, substitute
from robocup_vision.kernels.model_edges.strays import (
    Noise,
    find_crossed,
    nearest,
    off_alone,
    off_the_rest,
    shared_variance,
)
from robocup_vision.kernels.model_edges.tables import (
    UNKNOWNS,
    Buffers,
    Findings,
    FloatArray,
    FollowSettings,
    Int64Array,
)

BINS = 64  # number of bins of the histogram of residuals


class Gates(NamedTuple):
    """Widths (G,) of a fit's gates, pixels, and the number of steps after them whose gate follows the residuals."""

    width_px: FloatArray
    sharp_steps: int


@compiled(fastmath=True, error_model="numpy")
def msac(
    rows: FloatArray,
    count: int,
    found: Findings,
    z: FloatArray,
    gate_px: float,
    max_cost: float,
) -> float:
    """Return the cost of a hypothesis: squared residuals in units of the gate, at most 1 for each sample.

    The sum ends early where it reaches `max_cost`.
    """
    cost = 0.0
    for n in range(count):
        if cost >= max_cost:
            return cost
        if found.candidates[n] < 1:
            continue
        expected = 0.0
        for j in range(UNKNOWNS):
            expected += rows[n, j] * z[j]
        r = nearest(found, n, expected) / gate_px
        cost += min(r * r, 1.0)
    return cost


@compiled(fastmath=True, error_model="numpy")
def choose_mode(buffers: Buffers, count: int, draws: FloatArray, settings: FollowSettings, modes: FloatArray) -> int:
    """Find modes by random hypotheses, each the solution for three candidates and the prior; returns their number.

    Parameters
    ----------
    buffers : Buffers
        Candidates and derivatives of `count` samples.
    count : int
        Samples in use.
    draws : (H, 6) float64
        Numbers in [0, 1): which samples and candidates each hypothesis takes.
    settings : FollowSettings
        `gate_px` is used.
    modes : (K, 7) float64
        Result: the best hypothesis and the next best that differ from all before by more than two gates.
    """
    rows, found, gate_px = buffers.rows, buffers.found, settings.gate_px
    sigma_px = 0.5 * gate_px
    usable = np.empty(count, dtype=np.int64)
    number = 0
    for n in range(count):
        if found.candidates[n] > 0:
            usable[number] = n
            number += 1
    z = np.zeros(UNKNOWNS)
    small, right = np.empty((3, 3)), np.empty(3)
    pick, offset = np.empty(3, dtype=np.int64), np.empty(3)
    costs = np.empty(draws.shape[0] + 1)
    tried = np.zeros((draws.shape[0] + 1, UNKNOWNS))
    costs[0] = msac(rows, count, found, z, gate_px, 1e9)
    tried_count, first = 1, 0
    if number >= 3:
        for h in range(draws.shape[0]):
            for i in range(3):
                n = usable[int(draws[h, i] * number)]
                pick[i] = n
                offset[i] = found.offset_px[n, int(draws[h, 3 + i] * found.candidates[n])]
            for i in range(3):
                right[i] = offset[i]
                for k in range(i + 1):
                    total = 0.0
                    for j in range(UNKNOWNS):
                        total += rows[pick[i], j] * rows[pick[k], j]
                    small[i, k] = total
                small[i, i] += sigma_px * sigma_px
            if not factor(small, 3):
                continue
            substitute(small, 3, right)
            for j in range(UNKNOWNS):
                z[j] = rows[pick[0], j] * right[0] + rows[pick[1], j] * right[1] + rows[pick[2], j] * right[2]
            # where one mode is wanted, only the best cost is needed
            max_cost = costs[first] if modes.shape[0] == 1 else 1e9
            costs[tried_count] = msac(rows, count, found, z, gate_px, max_cost)
            for j in range(UNKNOWNS):
                tried[tried_count, j] = z[j]
            if costs[tried_count] < costs[first]:
                first = tried_count
            tried_count += 1
    kept = 0
    for _ in range(tried_count):
        least = -1
        for h in range(tried_count):
            if costs[h] < 1e8 and (least < 0 or costs[h] < costs[least]):
                least = h
        if least < 0:
            break
        apart = 2.0 * gate_px + 1.0
        for k in range(kept):
            farthest = 0.0
            for i in range(number):
                r = 0.0
                for j in range(UNKNOWNS):
                    r += rows[usable[i], j] * (tried[least, j] - modes[k, j])
                farthest = max(farthest, abs(r))
            apart = min(apart, farthest)
        costs[least] = 1e9
        if apart > 2.0 * gate_px:
            for j in range(UNKNOWNS):
                modes[kept, j] = tried[least, j]
            kept += 1
            if kept == modes.shape[0]:
                break
    return kept


@compiled(fastmath=True, error_model="numpy")
def _median_size(residual: FloatArray, weight: FloatArray, gate_px: float) -> float:
    """Median of the absolute residuals of inliers, pixels, to a fraction of a histogram's bin."""
    bins = np.zeros(BINS, np.int64)
    total = 0
    for n in range(residual.shape[0]):
        if weight[n] > 0.0:
            bins[min(int(abs(residual[n]) / gate_px * BINS), BINS - 1)] += 1
            total += 1
    below, k = 0, 0
    while k < BINS - 1 and 2 * (below + bins[k]) < total:
        below += bins[k]
        k += 1
    return float((k + (0.5 * total - below) / max(bins[k], 1)) * gate_px / BINS)


@compiled(fastmath=True, error_model="numpy")
def _object_count(feature: Int64Array, count: int) -> int:
    """Return one more than the greatest index k of an object (line, post, ...), whose edges are features 2k, 2k+1."""
    last = variable(0)
    for n in range(count):
        last = max(last, feature[n])
    return int(last >> 1) + 1


@compiled(fastmath=True, error_model="numpy")
def _gather(
    buffers: Buffers,
    count: int,
    weight: FloatArray,
    residual: FloatArray,
    noise: Noise,
    off2: FloatArray,
    own2: FloatArray,
    agree: FloatArray,
) -> None:
    """Compute information (7, 7) and gradient (7,) of the weighted residuals, and each object's weight in `agree`.

    Samples of one edge share the error of lens, paint and tape. Their covariance is that of their own noise and of a
    common offset; its inverse is that of the noise less a matrix of rank one. A sample may be stray: it may lie on
    another object, as one beside a crossing lies on the other line. The more samples of an object agree, the less
    probable it is that all are stray. If they are, the edge is off by up to the gate or as far as `off_the_rest` says;
    `off_alone` does the same for single samples.
    """
    rows, samples, information, gradient = buffers.rows, buffers.samples, buffers.information, buffers.gradient
    agree[:] = 0.0
    for n in range(count):
        agree[samples.feature[n] >> 1] += weight[n]
    common, common_weight, common_residual = np.zeros(UNKNOWNS), 0.0, 0.0
    feature = -1
    for i in range(UNKNOWNS):
        gradient[i] = 0.0
        for j in range(UNKNOWNS):
            information[i, j] = 0.0
    for n in range(count + 1):
        if n < count and weight[n] == 0.0:
            continue
        if n == count or samples.feature[n] != feature:
            shared2 = 0.0 if feature < 0 else shared_variance(noise, agree[feature >> 1], off2[feature >> 1])
            ratio = shared2 / (1.0 + shared2 * common_weight)
            for i in range(UNKNOWNS):
                a = ratio * common[i]
                gradient[i] -= a * common_residual
                for j in range(i + 1):
                    information[i, j] -= a * common[j]
            common_weight, common_residual = 0.0, 0.0
            for i in range(UNKNOWNS):
                common[i] = 0.0
            if n == count:
                break
            feature = samples.feature[n]
        w = weight[n] / (noise.sample_px**2 + weight[n] * own2[n])
        common_weight += w
        common_residual += w * residual[n]
        for i in range(UNKNOWNS):
            a = w * rows[n, i]
            common[i] += a
            gradient[i] += a * residual[n]
            for j in range(i + 1):
                information[i, j] += a * rows[n, j]
    for i in range(UNKNOWNS):
        for j in range(i):
            information[j, i] = information[i, j]


@compiled(fastmath=True, error_model="numpy")
def robust_fit(
    buffers: Buffers, count: int, settings: FollowSettings, gates: Gates, z0: FloatArray, z: FloatArray
) -> tuple[int, float, bool]:
    """Tukey-weighted Gauss-Newton steps under narrowing gates.

    Where the residuals scatter more than the stated noise, the noise is scaled up to their scatter.

    Parameters
    ----------
    buffers : Buffers
        Candidates and derivatives of `count` samples; takes information and gradient.
    count : int
        Samples in use.
    settings : FollowSettings
        The noise, `gate_px`, `stray_ratio` and `sharp_gates` are used.
    gates : Gates
        One gate for each step.
    z0 : (7,) float64
        The prior's mean, in the unknowns whose origin is where the samples were predicted.
    z : (7,) float64
        In: the start. Out: the fit.

    Returns
    -------
    int, float, bool
        Number of inliers of the narrowest given gate, root mean square of their residuals (pixels), and whether the
        equations could be solved.
    """
    rows, found = buffers.rows, buffers.found
    information, gradient = buffers.information, buffers.gradient
    system, step = np.empty((UNKNOWNS, UNKNOWNS)), np.empty(UNKNOWNS)
    weight, residual = np.empty(count), np.empty(count)
    inliers, rms, scale = 0, 0.0, 1.0
    gate_count = gates.width_px.shape[0]
    narrowest = gates.width_px[gate_count - 1]
    gate = narrowest
    stray_px = settings.gate_px / math.sqrt(3.0)
    allows_strays = settings.stray_ratio > 0.0 and gates.sharp_steps > 0
    off2 = np.zeros(_object_count(buffers.samples.feature, count))
    agree, own2, crossed = np.empty(off2.shape[0]), np.zeros(count), np.zeros(count, np.bool_)
    for iteration in range(gate_count + gates.sharp_steps + 1):
        if iteration < gate_count:
            gate = gates.width_px[iteration]
        inliers, total = 0, 0.0
        for n in range(count):
            weight[n] = 0.0
            if found.candidates[n] < 1:
                continue
            expected = 0.0
            for j in range(UNKNOWNS):
                expected += rows[n, j] * z[j]
            r = nearest(found, n, expected)
            # a sample that may be off has a wider gate, and counts less in the root mean square
            doubt = 1.0 + own2[n] / settings.sigma_px**2
            if abs(r) < narrowest:
                inliers += 1
                total += r * r / doubt
            sample_gate = min(gate * math.sqrt(doubt), narrowest) if doubt > 1.0 else gate
            if abs(r) < sample_gate:
                t = 1.0 - (r / sample_gate) ** 2
                weight[n], residual[n] = t * t, r
        rms = math.sqrt(total / inliers) if inliers else 0.0
        if iteration == gate_count - 1 and allows_strays:
            find_crossed(buffers, count, settings, z, settings.sigma_px * scale, weight, crossed)
        if iteration >= gate_count - 1:
            for n in range(count):
                if crossed[n]:
                    weight[n] = 0.0
        scale = max(1.0, 1.48 * _median_size(residual, weight, gate) / settings.sigma_px)
        noise = Noise(settings.sigma_px * scale, settings.shared_px * scale, stray_px, settings.stray_ratio)
        _gather(buffers, count, weight, residual, noise, off2, own2, agree)
        if iteration == gate_count + gates.sharp_steps:
            break
        if iteration >= gate_count - 1 and gates.sharp_steps > 0:
            gate = min(narrowest, settings.sharp_gates * noise.sample_px)
        for i in range(UNKNOWNS):
            step[i] = gradient[i] - (z[i] - z0[i])
            for j in range(UNKNOWNS):
                system[i, j] = information[i, j]
            system[i, i] += 1.0
        if not factor(system, UNKNOWNS):
            return inliers, rms, False
        if iteration == gate_count - 1 and allows_strays:
            off_the_rest(buffers, count, weight, residual, noise, system, agree, off2)
            off_alone(buffers, count, weight, residual, noise, system, agree, off2, own2)
        substitute(system, UNKNOWNS, step)
        for i in range(UNKNOWNS):
            z[i] += step[i]
    return inliers, rms, True
