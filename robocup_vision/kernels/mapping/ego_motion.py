"""Compiled loops that compare a range profile with earlier ones, seen again from a candidate pose."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.cholesky import factor, solve_symmetric, substitute

# rows of the present profile, (3, J): inverse range at bearing j * 2 pi / J (1/m, NaN where none), its variance, and
# its change from one bearing to the next
VALUE, VARIANCE, SLOPE = range(3)
# columns of an earlier profile, (M, 4): the points (NaN where none) in the frame of the pose sought, m; the variance of
# their range as measured then, and of how far what stands there may have moved since, along each axis; m^2
X, Y, RANGE_VARIANCE, MOVED_VARIANCE = range(4)
# fewer blocks than this cannot contradict a pose of three unknowns
_MIN_BLOCKS = 4
# neighbours are of one thing if they differ by less than this ratio of their inverse range, beyond their noise
_STEP_RATIO = 0.1


class Rules(NamedTuple):
    """How profiles are compared.

    min_inlier_ratio : an earlier profile is used if at least this ratio of what could be compared is within the gate.
    worth : independent measurements a bearing; below 1 where bearings have been smoothed over their neighbours.
    block : the errors of this many neighbouring bearings may be one.
    """

    min_inlier_ratio: float
    worth: float
    block: int


class Earlier(NamedTuple):
    """Earlier profiles.

    points : (k, M, 4) float64, see the columns' names.
    thing : (k, M) int64, which thing each point lies on; those of one are next to each other (and around the end).
    """

    points: FloatArray
    thing: Int64Array


class Prediction(NamedTuple):
    """What is known of the pose without the profiles: (3,) x, y, phi, and (3, 3) the inverse of its covariance."""

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
    """Whether two neighbouring inverse ranges (1/m), NaN for none, lie on different things."""
    return not abs(one - other) < 3.0 * math.sqrt(2.0 * variance) + _STEP_RATIO * other


@compiled
def smooth(
    inverse: FloatArray, variance: FloatArray, reach: int, value: FloatArray, spread: FloatArray, slope: FloatArray
) -> None:
    """Fit a straight wall through each direction's neighbours that lie on the same thing.

    In inverse range a straight wall is a cos(angle) + b sin(angle), whatever its distance; b, the slope, is fitted too.

    inverse, variance : (J,) inverse range, 1/m, NaN where none; and its variance.
    reach : neighbours on either side that may take part.
    value, spread, slope : (J,); written: 1/m, its variance, and 1/m per step; NaN where `inverse` is, or stands alone.
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
                near = inverse[(j + side * step) % count]
                # noise from one direction to the next is far smaller than a step in depth
                if _is_step(near, last, variance[j]):
                    break
                last = near
                cos, sin = math.cos(step * step_rad), math.sin(side * step * step_rad)
                cc += cos * cos
                cs += cos * sin
                ss += sin * sin
                c += cos * near
                s += sin * near
        size = cc * ss - cs * cs
        # one direction alone has no slope: it is mostly an edge between two things
        if ss > 0.0:
            value[j] = (ss * c - cs * s) / size
            slope[j] = (cc * s - cs * c) / size * step_rad
            spread[j] = variance[j] * ss / size


@compiled
def part(inverse: FloatArray, variance: FloatArray, thing: Int64Array) -> int:
    """Give numbers to the things seen: neighbouring directions with no step in depth between them.

    inverse, variance : (J,) inverse range, 1/m, NaN where none; and its variance.
    thing : (J,); written: numbers from 0; -1 where there is nothing.

    Returns how many there are.
    """
    count = inverse.shape[0]
    # begin at a gap, so that no thing is cut in two at direction 0
    first = 0
    for j in range(count):
        if _is_step(inverse[j - 1], inverse[j], variance[j]):
            first = j
            break
    things = 0
    for step in range(count):
        j = (first + step) % count
        if not inverse[j] > 0.0:
            thing[j] = -1
            continue
        if step == 0 or _is_step(inverse[j - 1], inverse[j], variance[j]):
            things += 1
        thing[j] = things - 1
    return things


@compiled
def widths(points: FloatArray, thing: Int64Array, width: FloatArray) -> None:
    """How wide each thing is: the diagonal of the box around its points (M, 2 or more); `width` (T,) is written, m."""
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
    """Add the information of one block of neighbouring bearings on the pose; the thing there may have moved.

    A thing that moves looks like a robot that moves the other way, so its own displacement, of variance
    `moved_variance` (m^2) along x and along y, has the columns of the pose's x and y; integrated out, it leaves
    N - N_t^T (N_tt + I / m^2)^-1 N_t of the block's normal matrix N.

    own_normal, own_slope : (3, 3) and (3,) as if the thing stood still; cleared.
    normal, slope, scatter : (3, 3), (3,) and (3, 3); added to; the last takes the slope's square.
    """
    xx, xy, yy = 0.0, 0.0, 0.0
    if moved_variance > 0.0:
        a, b, d = own_normal[0, 0] + 1.0 / moved_variance, own_normal[0, 1], own_normal[1, 1] + 1.0 / moved_variance
        size = a * d - b * b
        xx, xy, yy = d / size, -b / size, a / size
    left_x, left_y = own_slope[0], own_slope[1]
    for a in range(3):
        by_x = own_normal[a, 0] * xx + own_normal[a, 1] * xy
        by_y = own_normal[a, 0] * xy + own_normal[a, 1] * yy
        # the two columns by which the displacement enters are read until the end
        own_slope[a] -= by_x * left_x + by_y * left_y
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
    """Difference of a profile from one earlier profile seen from a pose: one i of Miura's eq. 1.

    present, past : (3, J) and (M, 4), see the rows' and columns' names.
    thing : (M,) which thing an earlier point lies on; those of one are next to each other (and around the end).
    pose : (3,) x, y, phi.
    gate : differences over this many standard deviations are skipped.
    nearest : (J,) scratch.
    sums : added to.

    Returns the sum of squared normalised differences, and how many bearings were counted, how many could have been,
    and how many blocks they made.
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
    total, counted, comparable, blocks, inside, last = 0.0, 0, 0, 0, 0, -1
    row, own_normal, own_slope = np.empty(3), np.zeros((3, 3)), np.zeros(3)
    for step in range(points):
        m = (start + step) % points
        dx, dy = past[m, X] - x, past[m, Y] - y
        squared = dx * dx + dy * dy
        if not squared > 0.0:
            continue
        seen = 1.0 / math.sqrt(squared)
        turn = (math.atan2(dy, dx) - phi) * per_rad
        place = int(math.floor(turn + 0.5))
        j = place % bearings
        if not present[VALUE, j] > 0.0:
            continue
        spread = present[VARIANCE, j] + past[m, RANGE_VARIANCE] / (squared * squared)
        limit = gate * math.sqrt(spread)
        # what a nearer thing of the earlier profile hides is not seen again
        if nearest[j] - seen > limit:
            continue
        comparable += 1
        off = present[VALUE, j] + (turn - place) * present[SLOPE, j] - seen
        if abs(off) > limit:
            continue
        if last >= 0 and (inside == block or thing[m] != thing[last]):
            _add_block(own_normal, own_slope, past[last, MOVED_VARIANCE], normal, slope, scatter)
            blocks += 1
            inside = 0
        last = m
        inside += 1
        counted += 1
        total += off * off / spread
        turned = present[SLOPE, j] * per_rad
        row[0] = (turned * dy - dx * seen) / squared
        row[1] = (-turned * dx - dy * seen) / squared
        row[2] = -turned
        for a in range(3):
            own_slope[a] += row[a] * off * worth / spread
            for b in range(3):
                own_normal[a, b] += row[a] * row[b] * worth / spread
    if last >= 0:
        _add_block(own_normal, own_slope, past[last, MOVED_VARIANCE], normal, slope, scatter)
        blocks += 1
    return total, counted, comparable, blocks


@compiled
def excess(normal: FloatArray, scatter: FloatArray, information: FloatArray, blocks: int) -> float:
    """Return how many times larger than stated the errors are, by the blocks' disagreement; at least 1.

    normal, information : (3, 3) information on the pose by the bearings, and without them.
    scatter : (3, 3) the blocks' slopes squared and added up: as large as `normal` if their errors are as stated and
    independent of each other.
    """
    whole, claims, shows = np.empty((3, 3)), np.empty(3), np.empty(3)
    for a in range(3):
        for b in range(3):
            whole[a, b] = normal[a, b] + information[a, b]
    if not factor(whole, 3):
        return 1.0
    claimed, shown = 0.0, 0.0
    for a in range(3):
        for b in range(3):
            claims[b], shows[b] = normal[b, a], scatter[b, a]
        substitute(whole, 3, claims)
        substitute(whole, 3, shows)
        claimed += claims[a]
        shown += shows[a]
    # three blocks' worth of disagreement has gone into the pose
    return max(1.0, shown / max(claimed, 1e-12) * blocks / (blocks - 3.0))


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
    """Miura's Diff(x, y, phi), with its normal matrix and its gradient, over k earlier profiles.

    information : (3, 3) what is known of the pose without the profiles.
    normal, slope : (3, 3) and (3,); overwritten. They are the mean over profiles of the mean over bearings, each
    profile by its `excess`, times the largest number of bearings that one of them gave: all have the same noise of the
    present profile, and together weigh as one of them does.

    Returns Diff, how many profiles were used, and the ratio of all that could be compared which agrees.
    """
    one, nearest = Sums(np.empty((3, 3)), np.empty(3), np.empty((3, 3))), np.empty(present.shape[1])
    normal[:] = 0.0
    slope[:] = 0.0
    total, used, most, agreeing, all_comparable = 0.0, 0, 0, 0, 0
    for i in range(earlier.points.shape[0]):
        one.normal[:] = 0.0
        one.slope[:] = 0.0
        one.scatter[:] = 0.0
        cost, counted, comparable, blocks = compare(
            present, earlier.points[i], earlier.thing[i], pose, gate, rules, nearest, one
        )
        agreeing += counted
        all_comparable += comparable
        if blocks < _MIN_BLOCKS or counted < rules.min_inlier_ratio * comparable:
            continue
        used += 1
        most = max(most, counted)
        total += cost / counted
        weight = 1.0 / (counted * excess(one.normal, one.scatter, information, blocks))
        for a in range(3):
            slope[a] += one.slope[a] * weight
            for b in range(3):
                normal[a, b] += one.normal[a, b] * weight
    for a in range(3):
        slope[a] *= most / max(used, 1)
        for b in range(3):
            normal[a, b] *= most / max(used, 1)
    return total, used, agreeing / max(all_comparable, 1)


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
    """Gauss-Newton on `difference` and the prediction, one step a gate; moves `pose` (3,) and leaves its `normal`.

    prediction : the pose by odometry.

    Returns how many profiles were used at the last step, and the ratio of bearings that agreed then; 0 profiles where
    at some step none could be used.
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
    """Which of the candidate poses (N, 3) lets most of the points (P, 4) agree; of equals, the first."""
    bearings = present.shape[1]
    per_rad = bearings / math.tau
    best, most = 0, -1
    for n in range(poses.shape[0]):
        agreeing = 0
        for p in range(points.shape[0]):
            dx, dy = points[p, X] - poses[n, 0], points[p, Y] - poses[n, 1]
            squared = dx * dx + dy * dy
            if not squared > 0.0:
                continue
            turn = (math.atan2(dy, dx) - poses[n, 2]) * per_rad
            place = int(math.floor(turn + 0.5))
            j = place % bearings
            off = present[VALUE, j] + (turn - place) * present[SLOPE, j] - 1.0 / math.sqrt(squared)
            spread = present[VARIANCE, j] + points[p, RANGE_VARIANCE] / (squared * squared)
            if off * off <= gate * gate * spread:
                agreeing += 1
        if agreeing > most:
            best, most = n, agreeing
    return best
