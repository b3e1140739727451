"""Compiled registration of a range profile with earlier ones, predicted from a candidate pose."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.cholesky import factor, solve_symmetric, substitute

# rows of the present profile, (3, J): inverse range at bearing j * 2 pi / J (1/m, NaN if none), its variance, and its
# change from one bearing to the next
VALUE, VARIANCE, SLOPE = range(3)
# columns of an earlier profile, (M, 4): points (NaN if none) in the frame of the pose to estimate, m; variance of their
# measured range, and of the displacement of the object there since then along each axis, m^2
X, Y, RANGE_VARIANCE, MOVED_VARIANCE = range(4)
# three unknowns can fit fewer blocks than this exactly
_MIN_BLOCKS = 4
# neighbours belong to one object if their inverse ranges differ by less than this ratio, beyond their noise
_STEP_RATIO = 0.1


class Rules(NamedTuple):
    """Settings of the comparison of profiles.

    min_inlier_ratio : least ratio of the comparable bearings within the gate for an earlier profile to be used.
    worth : independent measurements for each bearing; below 1 if bearings have been smoothed over their neighbours.
    block : number of neighbouring bearings whose errors may be identical.
    """

    min_inlier_ratio: float
    worth: float
    block: int


class Earlier(NamedTuple):
    """Earlier profiles.

    points : (k, M, 4) float64, see the columns' names.
    thing : (k, M) int64, object of each point; the points of one object are adjacent, cyclically.
    """

    points: FloatArray
    thing: Int64Array


class Prediction(NamedTuple):
    """Prior pose without the profiles: (3,) x, y, phi, and (3, 3) the inverse of its covariance."""

    pose: FloatArray
    information: FloatArray


class Sums(NamedTuple):
    """Sums over the compared bearings.

    normal, slope : (3, 3) of J^T J and (3,) of J^T r.
    scatter : (3, 3) of the outer products of the blocks' J^T r.
    """

    normal: FloatArray
    slope: FloatArray
    scatter: FloatArray


@compiled
def _is_step(one: float, other: float, variance: float) -> bool:
    """Whether two neighbouring inverse ranges (1/m), NaN for none, belong to different objects."""
    return not abs(one - other) < 3.0 * math.sqrt(2.0 * variance) + _STEP_RATIO * other


@compiled
def smooth(
    inverse: FloatArray, variance: FloatArray, reach: int, value: FloatArray, spread: FloatArray, slope: FloatArray
) -> None:
    """Fit a straight wall through each direction's neighbours that belong to the same object.

    In inverse range a straight wall is a cos(angle) + b sin(angle), whatever its distance.

    inverse, variance : (J,) inverse range, 1/m, NaN if none; and its variance.
    reach : greatest number of neighbours on either side.
    value, spread, slope : (J,); written: 1/m, its variance, and 1/m for each step; NaN for single directions.
    """
    count = inverse.shape[0]
    step_rad = math.tau / count
    for j in range(count):
        middle = inverse[j]
        value[j], spread[j], slope[j] = math.nan, math.nan, math.nan
        if not middle > 0.0:
            continue
        cc, cs, ss, c, s = 1.0, 0.0, 0.0, middle, 0.0
        for side in (-1, 1):
            last = middle
            for step in range(1, reach + 1):
                neighbour = inverse[(j + side * step) % count]
                # noise between neighbours is far smaller than a step in depth
                if _is_step(neighbour, last, variance[j]):
                    break
                last = neighbour
                cos, sin = math.cos(step * step_rad), math.sin(side * step * step_rad)
                cc += cos * cos
                cs += cos * sin
                ss += sin * sin
                c += cos * neighbour
                s += sin * neighbour
        determinant = cc * ss - cs * cs
        # a single direction has no slope; usually it is an edge between two objects
        if ss > 0.0:
            value[j] = (ss * c - cs * s) / determinant
            slope[j] = (cc * s - cs * c) / determinant * step_rad
            spread[j] = variance[j] * ss / determinant


@compiled
def part(inverse: FloatArray, variance: FloatArray, thing: Int64Array) -> int:
    """Assign numbers to the objects: runs of neighbouring directions without a step in depth.

    inverse, variance : (J,) inverse range, 1/m, NaN if none; and its variance.
    thing : (J,); written: numbers from 0; -1 without a range.

    Returns the number of objects.
    """
    count = inverse.shape[0]
    # start at a step, so that no object is divided at direction 0
    first = 0
    for j in range(count):
        if _is_step(inverse[j - 1], inverse[j], variance[j]):
            first = j
            break
    object_count = 0
    for step in range(count):
        j = (first + step) % count
        if not inverse[j] > 0.0:
            thing[j] = -1
            continue
        if step == 0 or _is_step(inverse[j - 1], inverse[j], variance[j]):
            object_count += 1
        thing[j] = object_count - 1
    return object_count


@compiled
def widths(points: FloatArray, thing: Int64Array, width: FloatArray) -> None:
    """Write the width (T,) of each object, m: the diagonal of the box around its points (M, 2 or more)."""
    low, high = np.full((len(width), 2), math.inf), np.full((len(width), 2), -math.inf)
    for m in range(len(thing)):
        if thing[m] >= 0:
            for axis in range(2):
                low[thing[m], axis] = min(low[thing[m], axis], points[m, axis])
                high[thing[m], axis] = max(high[thing[m], axis], points[m, axis])
    for t in range(len(width)):
        width[t] = math.hypot(high[t, 0] - low[t, 0], high[t, 1] - low[t, 1])


@compiled
def _add_block(
    own_normal: FloatArray,
    own_slope: FloatArray,
    moved_variance: float,
    normal: FloatArray,
    slope: FloatArray,
    scatter: FloatArray,
) -> None:
    """Add the information of one block of neighbouring bearings about the pose, given that the object may have moved.

    The object's displacement, of variance `moved_variance` (m^2) along x and y, has the same derivatives as the pose's
    x and y. Marginalised, it leaves N - N_t^T (N_tt + I / m^2)^-1 N_t of the block's normal matrix N.

    own_normal, own_slope : (3, 3) and (3,) for an object at rest; cleared.
    normal, slope, scatter : (3, 3), (3,) and (3, 3); added to; `scatter` takes the slope's outer product.
    """
    xx, xy, yy = 0.0, 0.0, 0.0
    if moved_variance > 0.0:
        a, b, d = own_normal[0, 0] + 1.0 / moved_variance, own_normal[0, 1], own_normal[1, 1] + 1.0 / moved_variance
        determinant = a * d - b * b
        xx, xy, yy = d / determinant, -b / determinant, a / determinant
    slope_x, slope_y = own_slope[0], own_slope[1]
    for a in range(3):
        by_x = own_normal[a, 0] * xx + own_normal[a, 1] * xy
        by_y = own_normal[a, 0] * xy + own_normal[a, 1] * yy
        # own_normal is not changed before the end of the loop
        own_slope[a] -= by_x * slope_x + by_y * slope_y
        slope[a] += own_slope[a]
        for b in range(3):
            normal[a, b] += own_normal[a, b] - by_x * own_normal[0, b] - by_y * own_normal[1, b]
    for a in range(3):
        for b in range(3):
            scatter[a, b] += own_slope[a] * own_slope[b]
    own_normal[:] = 0.0
    own_slope[:] = 0.0


@compiled
def compare(
    present: FloatArray,
    past: FloatArray,
    thing: Int64Array,
    pose: FloatArray,
    gate: float,
    rules: Rules,
    nearest: FloatArray,
    sums: Sums,
) -> tuple[float, int, int, int]:
    """Compare a profile with one earlier profile from a pose: the term of one i in Miura's eq. 1.

    present, past : (3, J) and (M, 4), see the rows' and columns' names.
    thing : (M,) object of each earlier point; the points of one object are adjacent, cyclically.
    pose : (3,) x, y, phi.
    gate : differences of more standard deviations are outliers.
    nearest : (J,) scratch.
    sums : added to.

    Returns the sum of squared normalised differences, the numbers of inlier and of comparable bearings, and the number
    of blocks.
    """
    worth, block = rules.worth, rules.block
    normal, slope, scatter = sums
    bearings, points = present.shape[1], past.shape[0]
    per_rad = bearings / math.tau
    x, y, phi = pose[0], pose[1], pose[2]
    nearest[:] = 0.0
    for m in range(points):
        dx, dy = past[m, X] - x, past[m, Y] - y
        distance = math.hypot(dx, dy)
        if distance > 0.0:
            j = int(math.floor((math.atan2(dy, dx) - phi) * per_rad + 0.5)) % bearings
            nearest[j] = max(nearest[j], 1.0 / distance)
    start = 0
    while start < points - 1 and thing[start] == thing[-1]:
        start += 1
    total, inliers, comparable, blocks, block_size, last = 0.0, 0, 0, 0, 0, -1
    row, own_normal, own_slope = np.empty(3), np.zeros((3, 3)), np.zeros(3)
    for step in range(points):
        m = (start + step) % points
        dx, dy = past[m, X] - x, past[m, Y] - y
        squared = dx * dx + dy * dy
        if not squared > 0.0:
            continue
        predicted = 1.0 / math.sqrt(squared)
        position = (math.atan2(dy, dx) - phi) * per_rad
        place = int(math.floor(position + 0.5))
        j = place % bearings
        if not present[VALUE, j] > 0.0:
            continue
        spread = present[VARIANCE, j] + past[m, RANGE_VARIANCE] / (squared * squared)
        limit = gate * math.sqrt(spread)
        # hidden by a nearer object of the earlier profile
        if nearest[j] - predicted > limit:
            continue
        comparable += 1
        residual = present[VALUE, j] + (position - place) * present[SLOPE, j] - predicted
        if abs(residual) > limit:
            continue
        if last >= 0 and (block_size == block or thing[m] != thing[last]):
            _add_block(own_normal, own_slope, past[last, MOVED_VARIANCE], normal, slope, scatter)
            blocks += 1
            block_size = 0
        last = m
        block_size += 1
        inliers += 1
        total += residual * residual / spread
        slope_per_rad = present[SLOPE, j] * per_rad
        row[0] = (slope_per_rad * dy - dx * predicted) / squared
        row[1] = (-slope_per_rad * dx - dy * predicted) / squared
        row[2] = -slope_per_rad
        for a in range(3):
            own_slope[a] += row[a] * residual * worth / spread
            for b in range(3):
                own_normal[a, b] += row[a] * row[b] * worth / spread
    if last >= 0:
        _add_block(own_normal, own_slope, past[last, MOVED_VARIANCE], normal, slope, scatter)
        blocks += 1
    return total, inliers, comparable, blocks


@compiled
def excess(normal: FloatArray, scatter: FloatArray, information: FloatArray, blocks: int) -> float:
    """Return the factor, at least 1, by which the errors exceed their stated variance, from the blocks' scatter.

    normal, information : (3, 3) information about the pose from the bearings, and from the prior.
    scatter : (3, 3) sum of the outer products of the blocks' slopes; its expectation is `normal` if the errors are as
    stated and independent.
    """
    total, expected_column, observed_column = np.empty((3, 3)), np.empty(3), np.empty(3)
    for a in range(3):
        for b in range(3):
            total[a, b] = normal[a, b] + information[a, b]
    if not factor(total, 3):
        return 1.0
    expected, observed = 0.0, 0.0
    for a in range(3):
        for b in range(3):
            expected_column[b], observed_column[b] = normal[b, a], scatter[b, a]
        substitute(total, 3, expected_column)
        substitute(total, 3, observed_column)
        expected += expected_column[a]
        observed += observed_column[a]
    # the fit of three unknowns reduces the degrees of freedom by three
    return max(1.0, observed / max(expected, 1e-12) * blocks / (blocks - 3.0))


@compiled(inline="always")
def difference(
    present: FloatArray,
    earlier: Earlier,
    pose: FloatArray,
    information: FloatArray,
    gate: float,
    rules: Rules,
    normal: FloatArray,
    slope: FloatArray,
) -> tuple[float, int, float]:
    """Compute Miura's Diff(x, y, phi), its normal matrix and its gradient, over k earlier profiles.

    information : (3, 3) prior information about the pose.
    normal, slope : (3, 3) and (3,); overwritten. Means over profiles of means over bearings, divided by the profile's
    `excess`, times the largest number of inliers of one profile: the profiles share the present profile's noise, so
    that together they have the information of one.

    Returns Diff, the number of profiles used, and the inlier ratio over all comparable bearings.
    """
    sums, nearest = Sums(np.empty((3, 3)), np.empty(3), np.empty((3, 3))), np.empty(present.shape[1])
    normal[:] = 0.0
    slope[:] = 0.0
    total, used, most, all_inliers, all_comparable = 0.0, 0, 0, 0, 0
    for i in range(earlier.points.shape[0]):
        sums.normal[:] = 0.0
        sums.slope[:] = 0.0
        sums.scatter[:] = 0.0
        cost, inliers, comparable, blocks = compare(
            present, earlier.points[i], earlier.thing[i], pose, gate, rules, nearest, sums
        )
        all_inliers += inliers
        all_comparable += comparable
        if blocks < _MIN_BLOCKS or inliers < rules.min_inlier_ratio * comparable:
            continue
        used += 1
        most = max(most, inliers)
        total += cost / inliers
        weight = 1.0 / (inliers * excess(sums.normal, sums.scatter, information, blocks))
        for a in range(3):
            slope[a] += sums.slope[a] * weight
            for b in range(3):
                normal[a, b] += sums.normal[a, b] * weight
    for a in range(3):
        slope[a] *= most / max(used, 1)
        for b in range(3):
            normal[a, b] *= most / max(used, 1)
    return total, used, all_inliers / max(all_comparable, 1)


@compiled
def refine(
    present: FloatArray,
    earlier: Earlier,
    pose: FloatArray,
    prediction: Prediction,
    gates: FloatArray,
    rules: Rules,
    normal: FloatArray,
) -> tuple[int, float]:
    """Refine `pose` (3,) by Gauss-Newton on `difference` and the prior, one step for each gate; writes `normal`.

    prediction : prior pose from odometry.

    Returns the number of profiles used in the last step, and the inlier ratio there; 0 profiles if a step failed.
    """
    slope, matrix = np.empty(3), np.empty((3, 3))
    predicted, information = prediction
    used, ratio = 0, 0.0
    for gate in gates:
        _, used, ratio = difference(present, earlier, pose, information, gate, rules, normal, slope)
        if used == 0:
            return 0, 0.0
        for a in range(3):
            for b in range(3):
                normal[a, b] += information[a, b]
                slope[a] += information[a, b] * (pose[b] - predicted[b])
                matrix[a, b] = normal[a, b]
        if not solve_symmetric(matrix, slope):
            return 0, 0.0
        for a in range(3):
            pose[a] -= slope[a]
    return used, ratio


@compiled
def search(present: FloatArray, points: FloatArray, poses: FloatArray, gate: float) -> int:
    """Return the first of the candidate poses (N, 3) with the most inliers among the points (P, 4)."""
    bearings = present.shape[1]
    per_rad = bearings / math.tau
    best, most = 0, -1
    for n in range(poses.shape[0]):
        inliers = 0
        for p in range(points.shape[0]):
            dx, dy = points[p, X] - poses[n, 0], points[p, Y] - poses[n, 1]
            squared = dx * dx + dy * dy
            if not squared > 0.0:
                continue
            position = (math.atan2(dy, dx) - poses[n, 2]) * per_rad
            place = int(math.floor(position + 0.5))
            j = place % bearings
            residual = present[VALUE, j] + (position - place) * present[SLOPE, j] - 1.0 / math.sqrt(squared)
            spread = present[VARIANCE, j] + points[p, RANGE_VARIANCE] / (squared * squared)
            if residual * residual <= gate * gate * spread:
                inliers += 1
        if inliers > most:
            best, most = n, inliers
    return best
