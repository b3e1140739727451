"""Compiled loops that compare a range profile with earlier ones, seen again from a candidate pose."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

FloatArray = npt.NDArray[np.float64]


@njit(cache=True, nogil=True)
def smooth(
    inverse: FloatArray, variance: FloatArray, reach: int, value: FloatArray, spread: FloatArray, slope: FloatArray
) -> None:
    """Straight lines through each direction's neighbours that lie on the same thing: value, its variance and slope.

    inverse, variance : (J,) inverse range, 1/m, NaN where none; and its variance.
    reach : neighbours on either side that may take part.
    value, spread, slope : (J,); written: 1/m, its variance, and 1/m per step; NaN where `inverse` is.
    """
    count = inverse.shape[0]
    for j in range(count):
        middle = inverse[j]
        value[j], spread[j], slope[j] = math.nan, math.nan, math.nan
        if not middle > 0.0:
            continue
        weight, offset, offsets, total, product = 1.0, 0.0, 0.0, middle, 0.0
        for side in (-1, 1):
            last = middle
            for step in range(1, reach + 1):
                near = inverse[(j + side * step) % count]
                # a step in depth is far larger than noise from one direction to the next
                if not abs(near - last) < 3.0 * math.sqrt(2.0 * variance[j]) + 0.1 * middle:
                    break
                last = near
                weight += 1.0
                offset += side * step
                offsets += step * step
                total += near
                product += side * step * near
        across = weight * offsets - offset * offset
        if across > 0.0:
            slope[j] = (weight * product - offset * total) / across
            value[j] = (total - slope[j] * offset) / weight
            spread[j] = variance[j] * offsets / across
        else:
            slope[j], value[j], spread[j] = 0.0, middle, variance[j]


@njit(cache=True, nogil=True)
def compare(
    inverse: FloatArray,
    variance: FloatArray,
    along: FloatArray,
    past_xy: FloatArray,
    past_range_variance: FloatArray,
    x: float,
    y: float,
    phi: float,
    gate: float,
    nearest: FloatArray,
    normal: FloatArray,
    slope: FloatArray,
) -> tuple[float, int, int]:
    """Difference of a profile from one earlier profile seen from the pose (x, y, phi): one i of Miura's eq. 1.

    inverse, variance : (J,) inverse range at bearings j * 2 pi / J, 1/m, NaN where none; and its variance.
    past_xy, past_range_variance : (M, 2) and (M,) the earlier profile's points in the frame of the pose, metres, NaN
    where none; and the variance of their range as measured then, m^2.
    gate : differences over this many standard deviations are skipped.
    nearest : (J,) scratch.
    normal, slope : (3, 3) and (3,); the sums of J^T J and of J^T r are added to them.

    Returns the sum of squared normalised differences, how many were counted, and how many could have been.
    """
    bearings, points = inverse.shape[0], past_xy.shape[0]
    per_rad = bearings / math.tau
    nearest[:] = 0.0
    for m in range(points):
        dx, dy = past_xy[m, 0] - x, past_xy[m, 1] - y
        distance = math.hypot(dx, dy)
        if distance > 0.0:
            j = int(math.floor((math.atan2(dy, dx) - phi) * per_rad + 0.5)) % bearings
            nearest[j] = max(nearest[j], 1.0 / distance)
    total, counted, comparable = 0.0, 0, 0
    row = np.empty(3)
    for m in range(points):
        dx, dy = past_xy[m, 0] - x, past_xy[m, 1] - y
        squared = dx * dx + dy * dy
        if not squared > 0.0:
            continue
        seen = 1.0 / math.sqrt(squared)
        turn = (math.atan2(dy, dx) - phi) * per_rad
        place = int(math.floor(turn + 0.5))
        j = place % bearings
        if not inverse[j] > 0.0:
            continue
        spread = variance[j] + past_range_variance[m] * seen * seen * seen * seen
        limit = gate * math.sqrt(spread)
        # what a nearer thing of the earlier profile hides is not seen again
        if nearest[j] - seen > limit:
            continue
        comparable += 1
        difference = inverse[j] + (turn - place) * along[j] - seen
        if abs(difference) > limit:
            continue
        turned = along[j] * per_rad
        cube = seen * seen * seen
        row[0] = turned * dy * seen * seen - dx * cube
        row[1] = -turned * dx * seen * seen - dy * cube
        row[2] = -turned
        total += difference * difference / spread
        counted += 1
        for a in range(3):
            slope[a] += row[a] * difference / spread
            for b in range(3):
                normal[a, b] += row[a] * row[b] / spread
    return total, counted, comparable


@njit(cache=True, nogil=True)
def difference(
    inverse: FloatArray,
    variance: FloatArray,
    along: FloatArray,
    past_xy: FloatArray,
    past_range_variance: FloatArray,
    pose: FloatArray,
    gate: float,
    least_share: float,
    nearest: FloatArray,
    normal: FloatArray,
    slope: FloatArray,
) -> tuple[float, int, int, float]:
    """Miura's Diff(x, y, phi), its normal matrix and its gradient over k earlier profiles.

    past_xy, past_range_variance : (k, M, 2) and (k, M) as in `compare`.
    pose : (3,) x, y, phi.
    least_share : an earlier profile is used if at least this share of what could be compared is within the gate.
    normal, slope : (3, 3) and (3,); overwritten.

    Returns the sum over profiles of the mean squared difference, how many profiles were used, the largest number of
    bearings that one of them gave, and the share of all that could be compared which agree. `normal` and `slope` are
    of that sum.
    """
    one_normal, one_slope = np.empty((3, 3)), np.empty(3)
    normal[:] = 0.0
    slope[:] = 0.0
    total, used, most, agreeing, all_comparable = 0.0, 0, 0, 0, 0
    for i in range(past_xy.shape[0]):
        one_normal[:] = 0.0
        one_slope[:] = 0.0
        cost, counted, comparable = compare(
            inverse, variance, along, past_xy[i], past_range_variance[i], pose[0], pose[1], pose[2], gate, nearest,
            one_normal, one_slope,
        )  # fmt: skip
        agreeing += counted
        all_comparable += comparable
        if counted < 3 or counted < least_share * comparable:
            continue
        used += 1
        most = max(most, counted)
        total += cost / counted
        for a in range(3):
            slope[a] += one_slope[a] / counted
            for b in range(3):
                normal[a, b] += one_normal[a, b] / counted
    return total, used, most, agreeing / max(all_comparable, 1)


@njit(cache=True, nogil=True)
def refine(
    inverse: FloatArray,
    variance: FloatArray,
    along: FloatArray,
    past_xy: FloatArray,
    past_range_variance: FloatArray,
    pose: FloatArray,
    predicted: FloatArray,
    information: FloatArray,
    gates: FloatArray,
    least_share: float,
    worth: float,
    normal: FloatArray,
) -> tuple[float, int, float]:
    """Gauss-Newton on `difference` and the prediction, one step a gate; moves `pose` (3,) and leaves its `normal`.

    predicted, information : (3,) and (3, 3) the pose that odometry says and the inverse of its covariance.
    worth : independent measurements a bearing; below 1 where bearings have been smoothed over their neighbours.

    Returns the mean difference over the profiles used, how many those were, and the share of bearings that agree.
    """
    bearings = inverse.shape[0]
    nearest, slope = np.empty(bearings), np.empty(3)
    total, used, most, share = 0.0, 0, 0, 0.0
    for gate in gates:
        total, used, most, share = difference(
            inverse, variance, along, past_xy, past_range_variance, pose, gate, least_share, nearest, normal, slope
        )
        if used == 0:
            return 0.0, 0, 0.0
        # the profiles share the noise of the present one: together they weigh as one of them does
        scale = worth * most / used
        for a in range(3):
            slope[a] *= scale
            for b in range(3):
                normal[a, b] = normal[a, b] * scale + information[a, b]
                slope[a] += information[a, b] * (pose[b] - predicted[b])
        pose -= np.linalg.solve(normal, slope)
    return total / used, used, share


@njit(cache=True, nogil=True)
def search(
    inverse: FloatArray,
    variance: FloatArray,
    along: FloatArray,
    past_xy: FloatArray,
    past_range_variance: FloatArray,
    poses: FloatArray,
    gate: float,
) -> int:
    """Which of the candidate poses (N, 3) lets the largest share of bearings agree with the earlier profiles."""
    nearest, normal, slope = np.empty(inverse.shape[0]), np.empty((3, 3)), np.empty(3)
    best, best_share = 0, -1.0
    for n in range(poses.shape[0]):
        share = difference(
            inverse, variance, along, past_xy, past_range_variance, poses[n], gate, 0.0, nearest, normal, slope
        )[3]
        if share > best_share:
            best, best_share = n, share
    return best
