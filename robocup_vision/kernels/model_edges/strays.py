"""Estimates how far off a sample may be because it lies on another object than its edge (a stray sample).

A fit follows a stray sample that alone determines a direction, so that its residual is close to zero. Only the other
samples, the prior and the other lines reveal it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import BoolArray
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.cholesky import substitute
from robocup_vision.kernels.model_edges.tables import ON_FLOOR, UNKNOWNS, Buffers, Findings, FloatArray, FollowSettings

# an object is not treated as stray if the probability that all of its samples are stray is lower
_MIN_ALL_STRAY = 0.01
# lines whose normals have a greater cosine between them do not cross: within a few pixels they hardly diverge
_MAX_COSINE = 0.97


class Noise(NamedTuple):
    """Standard deviation of a sample alone, of the offset that all samples of an edge share, and of a stray sample.

    `stray_ratio` is the fraction of the samples that are stray.
    """

    sample_px: float
    shared_px: float
    stray_px: float
    stray_ratio: float


@compiled(fastmath=True, error_model="numpy")
def nearest(found: Findings, n: int, expected: float) -> float:
    """Return the residual of sample n's candidate nearest to the expected offset; 1e9 without candidates."""
    best, least = 1e9, 1e9
    for k in range(found.candidates[n]):
        r = found.offset_px[n, k] - expected
        if abs(r) < least:
            least, best = abs(r), r
    return best


@compiled(fastmath=True, error_model="numpy")
def find_crossed(
    buffers: Buffers,
    count: int,
    settings: FollowSettings,
    z: FloatArray,
    noise_px: float,
    weight: FloatArray,
    crossed: BoolArray,
) -> None:
    """Fill in whether the candidate of a sample on a line lies on another line that was found and crosses it there.

    Such a candidate belongs to the other line. `noise_px` is the standard deviation of one sample.
    """
    rows, found, samples = buffers.rows, buffers.found, buffers.samples
    gate_px, near_px = settings.sharp_gates * noise_px, settings.coarse_spacing_px
    sample_of, number = np.empty(count, np.int64), 0
    # pixel of each candidate; normal of each line, and its distance from the picture's corner along the normal
    place, line = np.empty((count, 2)), np.empty((count, 3))
    for n in range(count):
        crossed[n] = False
        if weight[n] == 0.0 or samples.place[n] != ON_FLOOR:
            continue
        expected = 0.0
        for j in range(UNKNOWNS):
            expected += rows[n, j] * z[j]
        offset = expected + nearest(found, n, expected)
        u, v, nu, nv = samples.uv[n, 0], samples.uv[n, 1], samples.normal[n, 0], samples.normal[n, 1]
        place[number, 0], place[number, 1] = u + offset * nu, v + offset * nv
        line[number, 0], line[number, 1], line[number, 2] = nu, nv, nu * u + nv * v + expected
        sample_of[number] = n
        number += 1
    for i in range(number):
        object_index, u, v = samples.feature[sample_of[i]] >> 1, place[i, 0], place[i, 1]
        for k in range(number):
            if abs(line[k, 0] * u + line[k, 1] * v - line[k, 2]) > gate_px:
                continue
            if abs(place[k, 0] - u) > near_px or abs(place[k, 1] - v) > near_px:
                continue
            cosine = abs(line[i, 0] * line[k, 0] + line[i, 1] * line[k, 1])
            if cosine < _MAX_COSINE and samples.feature[sample_of[k]] >> 1 != object_index:
                crossed[sample_of[i]] = True
                break


@compiled(fastmath=True, error_model="numpy")
def shared_variance(noise: Noise, agree: float, off2: float) -> float:
    """Return the variance of an edge's shared offset, px squared, including the chance that all samples are stray.

    `agree` is the total weight of the object's samples, `off2` as in `off_the_rest`.
    """
    return float(noise.shared_px**2 + (noise.stray_px**2 + off2) * noise.stray_ratio**agree)


@compiled(fastmath=True, error_model="numpy")
def off_the_rest(
    buffers: Buffers,
    count: int,
    weight: FloatArray,
    residual: FloatArray,
    noise: Noise,
    root: FloatArray,
    agree: FloatArray,
    off2: FloatArray,
) -> None:
    """Fill in how far each object's samples lie from where all other samples and the prior predict them, px squared.

    The residual that an object would have without itself in the fit is its residual divided by one minus its leverage.
    `root` is the Cholesky factor of the fit's system, `agree` is as in `_gather`. Objects with too many samples to be
    stray keep 0.
    """
    rows, feature = buffers.rows, buffers.samples.feature
    mean_row, mean_residual = np.zeros((off2.shape[0], UNKNOWNS)), np.zeros(off2.shape[0])
    for n in range(count):
        index, product = feature[n] >> 1, 0.0
        if weight[n] == 0.0 or noise.stray_ratio ** agree[index] < _MIN_ALL_STRAY:
            continue
        for j in range(UNKNOWNS):
            product += rows[n, j] * mean_row[index, j]
        # the two edges of a line may look in opposite directions
        w = (-weight[n] if product < 0.0 else weight[n]) / agree[index]
        for j in range(UNKNOWNS):
            mean_row[index, j] += w * rows[n, j]
        mean_residual[index] += w * residual[n]
    part = np.empty(UNKNOWNS)
    for index in range(off2.shape[0]):
        if agree[index] == 0.0 or noise.stray_ratio ** agree[index] < _MIN_ALL_STRAY:
            continue
        for j in range(UNKNOWNS):
            part[j] = mean_row[index, j]
        substitute(root, UNKNOWNS, part)
        predicted = 0.0
        for j in range(UNKNOWNS):
            predicted += part[j] * mean_row[index, j]
        variance = noise.sample_px**2 / agree[index] + shared_variance(noise, agree[index], 0.0)
        off2[index] = (mean_residual[index] / max(1.0 - predicted / variance, 0.01)) ** 2


@compiled(fastmath=True, error_model="numpy")
def off_alone(
    buffers: Buffers,
    count: int,
    weight: FloatArray,
    residual: FloatArray,
    noise: Noise,
    root: FloatArray,
    agree: FloatArray,
    off2: FloatArray,
    own2: FloatArray,
) -> None:
    """Fill in how far each single sample may be off, px squared.

    Samples of one edge may determine different directions: of a circle's samples, those on its far side say nothing
    about its place along the line through its centre, and the one at the crossing may belong to that line. So each
    sample is compared with its prediction by all others and the prior, whose variance determines the odds that it is
    stray. A sample that may be far off gets a small weight. Arguments are as in `off_the_rest`, which is called first.
    """
    feature, begin = buffers.samples.feature, 0
    for n in range(1, count + 1):
        if n == count or feature[n] != feature[begin]:
            index = feature[begin] >> 1
            shared2 = shared_variance(noise, agree[index], 0.0)
            doubt2 = shared_variance(noise, agree[index], off2[index]) - noise.shared_px**2
            _doubt_each(buffers, begin, n, weight, residual, noise, root, shared2, doubt2, own2)
            begin = n


@compiled(fastmath=True, error_model="numpy")
def _doubt_each(
    buffers: Buffers,
    begin: int,
    end: int,
    weight: FloatArray,
    residual: FloatArray,
    noise: Noise,
    root: FloatArray,
    shared2: float,
    doubt2: float,
    own2: FloatArray,
) -> None:
    """Do `off_alone` for the samples from `begin` to `end`, which share an offset.

    `doubt2` is the part of the shared variance for the chance that the whole object is stray. The prediction without a
    sample follows from the fit with it, by the sample's leverage.
    """
    rows, precision = buffers.rows, 1.0 / noise.sample_px**2
    common, part, common_weight, common_residual = np.zeros(UNKNOWNS), np.empty(UNKNOWNS), 0.0, 0.0
    for n in range(begin, end):
        own2[n] = 0.0
        w = weight[n] * precision
        if w == 0.0:
            continue
        common_weight += w
        common_residual += w * residual[n]
        for i in range(UNKNOWNS):
            common[i] += w * rows[n, i]
    stray_density = noise.stray_ratio / (math.sqrt(12.0) * noise.stray_px)
    for n in range(begin, end):
        w = weight[n] * precision
        if w == 0.0:
            continue
        # how well the other samples of the edge determine the shared offset
        shared_gain = shared2 / (1.0 + shared2 * (common_weight - w))
        variance, by_fit2 = 1.0 / w + shared_gain, 0.0
        for i in range(UNKNOWNS):
            part[i] = rows[n, i] - shared_gain * (common[i] - w * rows[n, i])
            for k in range(i):
                part[i] -= root[i, k] * part[k]
            part[i] /= root[i, i]
            by_fit2 += part[i] * part[i]
        remainder = max(1.0 - by_fit2 / variance, 0.01)
        error = (residual[n] - shared_gain * (common_residual - w * residual[n])) / remainder
        predicted2 = by_fit2 / remainder
        spread2 = predicted2 + variance
        density = (1.0 - noise.stray_ratio) * math.exp(-0.5 * error * error / spread2) / math.sqrt(math.tau * spread2)
        odds = stray_density / max(density, 1e-9)
        own2[n] = max(odds * (error * error + min(predicted2, noise.stray_px**2)) - doubt2, 0.0)
